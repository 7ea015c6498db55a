"""
Publish frames and touches of an optical touch pad, as a lifecycle node.

A board that was unplugged is looked for until it is back, also under another name of its port.
The log has one line at its loss and one at its return, /diagnostics an error in between. Baseline
and untouched signals of before are kept, because the pad may be touched at its return; a board
with another serial number has another pad, which must be untouched then.
"""

from collections import deque
from dataclasses import replace
import sys
from threading import Event
from threading import Thread
import time
import traceback

from diagnostic_msgs.msg import DiagnosticArray
from diagnostic_msgs.msg import DiagnosticStatus
from diagnostic_msgs.msg import KeyValue
from geometry_msgs.msg import TransformStamped
from geometry_msgs.msg import WrenchStamped
import optopad
from optopad.design.errors import DeviceError
from optopad.design.errors import OptopadError
from optopad.design.errors import OutputError
from optopad.fabrication.driver import ros_fields as fields
from optopad.fabrication.driver.recording.mcap_file import frame_message
from optopad.fabrication.driver.recording.mcap_file import sensor_message
from optopad_msgs.msg import Contact
from optopad_msgs.msg import Frame
from optopad_msgs.msg import Sensor
from optopad_msgs.msg import Touch
from optopad_msgs.srv import Record
from rcl_interfaces.msg import ParameterDescriptor
import rclpy
from rclpy.clock import Clock
from rclpy.clock import ClockType
from rclpy.executors import ExternalShutdownException
from rclpy.lifecycle import LifecycleNode
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.qos import DurabilityPolicy
from rclpy.qos import QoSProfile
from rclpy.task import Future
from std_srvs.srv import Trigger
from tf2_ros.static_transform_broadcaster import StaticTransformBroadcaster
from visualization_msgs.msg import Marker

PARAMETERS = {
    'config': '',
    'port': '',
    'model': '',
    'touches': 1,
    'rate': -1.0,
    'frame_id': 'optopad',
    'patience': 3.0,
    'autostart': False,
}
DIAGNOSTICS_S = 1.0
RECENT_REPORTS = 10  # frames lost within these are a warning
LOOK_S = 0.2  # longest time without a look at requests
AGAIN_S = 1.0  # between two attempts to open the sensor
CLOSING_S = 5.0


class SensorNode(LifecycleNode):
    """
    Publish a sensor's frames, and the touches that a model finds in them.

    Topics: frame, touch, wrench (with a model of force), sensor (kept for late subscribers),
    marker, /diagnostics.
    Services: baseline, self_test, record.
    All stamps are times of the node's clock. The future `failed` is done when the node's thread
    has ended by a fault of its own; the process must then end, so that it can be started again.
    """

    def __init__(self, name='sensor', **options):
        super().__init__(name, **options)
        self._patience_s = PARAMETERS['patience']
        for parameter, value in PARAMETERS.items():
            self.declare_parameter(
                parameter, value, ParameterDescriptor(dynamic_typing=True))  # rate: 200, too
        self.failed = Future()
        self._over = Event()
        self._renew = Event()
        self._thread = None
        self._sensor = None
        self._recorder = None
        self._clear()

    def start(self):
        """Configure and activate the node if the parameter `autostart` is true."""
        try:
            is_wanted = self._value('autostart')
        except OptopadError as err:
            self.get_logger().error(str(err))
            return
        if is_wanted and self.trigger_configure() == TransitionCallbackReturn.SUCCESS:
            self.trigger_activate()

    def on_configure(self, state):
        """Read the driver file and the model, and create topics and services."""
        try:
            self._open_files()
        except OptopadError as err:
            self.get_logger().error(str(err))
            return TransitionCallbackReturn.FAILURE
        kept = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._frames = self.create_lifecycle_publisher(Frame, 'frame', 50)
        self._touches = self.create_lifecycle_publisher(Touch, 'touch', 50)
        self._wrenches = self.create_lifecycle_publisher(WrenchStamped, 'wrench', 50)
        self._sensors = self.create_publisher(Sensor, 'sensor', kept)
        self._markers = self.create_publisher(Marker, 'marker', kept)
        self._status = self.create_publisher(DiagnosticArray, '/diagnostics', 10)
        self._offered = [
            self.create_service(Trigger, 'baseline', self._take_baseline),
            self.create_service(Trigger, 'self_test', self._self_test),
            self.create_service(Record, 'record', self._record),
        ]
        self._transforms = StaticTransformBroadcaster(self)
        self._timer = self.create_timer(
            DIAGNOSTICS_S, self._report, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._describe()
        return TransitionCallbackReturn.SUCCESS

    def on_activate(self, state):
        """Open the sensor and publish in a thread of its own."""
        self._over.clear()
        self._clear()
        self._thread = Thread(target=self._run, name='optopad sensor node', daemon=True)
        self._thread.start()
        return super().on_activate(state)

    def on_deactivate(self, state):
        """Stop the sensor and close its port."""
        self._stop()
        self._clear()
        return super().on_deactivate(state)

    def on_cleanup(self, state):
        """Remove topics and services."""
        self._stop()
        self.destroy_timer(self._timer)
        for service in self._offered:
            self.destroy_service(service)
        for publisher in (self._frames, self._touches, self._wrenches, self._sensors,
                          self._markers, self._status):
            self.destroy_publisher(publisher)
        return TransitionCallbackReturn.SUCCESS

    def on_shutdown(self, state):
        """Stop the sensor."""
        self._stop()
        return TransitionCallbackReturn.SUCCESS

    def _clear(self):
        self._renew.clear()
        self._fault = ''
        self._lost_at = None
        self._serial_number = ''
        self._shown = 0
        self._counts = deque(maxlen=RECENT_REPORTS)
        self._node_clock = fields.NodeClock()

    def _value(self, name):
        return fields.parameter(name, self.get_parameter(name).value, PARAMETERS[name])

    def _now_s(self):
        return self.get_clock().now().nanoseconds / 1e9

    def _open_files(self):
        if not self._value('config'):
            raise OptopadError('config: is empty; give the driver.toml of the sensor')
        rate, model = self._value('rate'), self._value('model')
        self._frame_id, self._patience_s = self._value('frame_id'), self._value('patience')
        self._device = optopad.Sensor(
            self._value('config'),
            self._value('port') or None,
            rate_hz=None if rate < 0.0 else rate,
            patience_s=self._patience_s,
            gather_s=0.0,
            on_wait=self._wait,
        )
        self._model = optopad.load_model(model) if model else None
        if self._model is not None:
            self._reader(self._device)  # refuses a model of another design, or of one touch

    def _reader(self, sensor):
        return optopad.TouchReader(sensor, self._model, touches=self._value('touches'))

    def _describe(self):
        now_s = self._now_s()
        said = sensor_message(self._device.config, now_s)
        said['header']['frame_id'] = self._frame_id
        self._sensors.publish(fields.filled(Sensor(), said))
        self._transforms.sendTransform(fields.filled(
            TransformStamped(),
            fields.top_frame(self._device.descriptor, self._frame_id, now_s)))
        self._mark_body()

    def _run(self):
        try:
            while not self._over.is_set():
                try:
                    self._read()
                except OutputError as err:
                    self.get_logger().error(str(err))
                except OptopadError as err:
                    self._lose(str(err))
                    self._over.wait(AGAIN_S)
        except Exception as err:  # our own fault: the process ends, and can be started again
            if self._over.is_set() or not self.context.ok():
                return  # ROS has ended under a message that was being sent
            self._fault = f'{type(err).__name__}: {err}'
            self.get_logger().fatal(f'ends by a fault of its own: {traceback.format_exc()}')
            self.failed.set_result(err)

    def _read(self):
        """Open the sensor and publish until the node is deactivated."""
        with self._device as sensor:
            self._sensor = sensor
            try:
                reader = None if self._model is None else self._reader(sensor)
                while not self._over.is_set():
                    try:
                        self._publish(sensor, reader)
                    except OutputError as err:  # the recording has ended; the frames continue
                        self._recorder = None
                        self.get_logger().error(str(err))
                    except DeviceError:  # the driver goes on looking for the board
                        self._over.wait(LOOK_S)
                    self._look(sensor)
            finally:
                self._sensor = self._recorder = None

    def _publish(self, sensor, reader):
        """Publish what arrives within `LOOK_S`."""
        if self._renew.is_set():
            self._renew.clear()
            sensor.take_baseline()
            if reader is not None:
                reader.restart()
        found = sensor.frames if reader is None else reader.touches
        for read in found(seconds=LOOK_S):
            if self._over.is_set():
                return
            frame = self._on_clock(read if reader is None else read.frame)
            if reader is not None:
                self._publish_touch(replace(read, frame=frame))
            self._publish_frame(frame)

    def _on_clock(self, frame):
        is_simulated = self.get_clock().ros_time_is_active
        return self._node_clock.frame(frame, self._now_s() if is_simulated else None)

    def _publish_touch(self, touch):
        message = fields.touch_message(touch, self._frame_id, Contact)
        self._touches.publish(fields.filled(Touch(), message))
        if touch.force_n is not None:
            wrench = fields.wrench_message(touch, self._frame_id)
            self._wrenches.publish(fields.filled(WrenchStamped(), wrench))
        self._show(touch.contacts, touch.frame.began_s)

    def _look(self, sensor):
        fault = sensor.fault
        if fault:
            self._show((), self._now_s())
            if sensor.silent_s >= sensor.patience_s:
                self._lose(fault, sensor.silent_s)
        elif sensor.counts.frames:
            self._find(sensor)

    def _lose(self, fault, silent_s=0.0):
        if self._lost_at is None and not self._over.is_set():
            self._lost_at = time.monotonic() - silent_s
            self.get_logger().error(f'{fault}; waiting for the board')
        self._fault = fault

    def _find(self, sensor):
        if self._lost_at is not None:
            lost_s = time.monotonic() - self._lost_at
            self.get_logger().info(f'{sensor.port}: reading again after {lost_s:.0f} s')
            self._lost_at, self._fault = None, ''
        before, now = self._serial_number, sensor.serial_number
        self._serial_number = now or before
        if before and now and now != before:
            self.get_logger().warning(
                f'{sensor.port}: another board, {now} after {before}; its pad must be untouched')
            self._renew.set()

    def _wait(self, line):
        """Log the progress of the first opening; called by the driver."""
        if self._over.is_set():
            raise DeviceError('closed while the board was looked for')
        if self._lost_at is None:
            self.get_logger().info(line)

    def _publish_frame(self, frame):
        self._frames.publish(fields.filled(Frame(), frame_message(frame, self._frame_id)))

    def _mark_body(self):
        self._mark(fields.body_marker(
            self._device.descriptor, self._frame_id, self._now_s()))

    def _show(self, contacts, time_s):
        for shown in fields.contact_markers(contacts, self._shown, self._frame_id, time_s):
            self._mark(shown)
        self._shown = len(contacts)

    def _mark(self, shown):
        self._markers.publish(fields.filled(Marker(), shown))

    def _stop(self):
        self._over.set()
        if self._thread is not None:
            self._thread.join(self._patience_s + CLOSING_S)
            self._thread = None

    def _report(self):
        sensor, config = self._sensor, self._device.config
        counts = None if sensor is None else sensor.counts
        found = fields.diagnosis(
            counts,
            self._counts[0] if self._counts else None,
            None if sensor is None else sensor.rate_hz,
            self._device.descriptor.required_rate_hz,
            self._fault or ('' if sensor is None else sensor.fault),
        )
        self._counts.extend([] if counts is None else [counts])
        port = self._value('port') if sensor is None else sensor.port
        found['values'] |= {
            'design': config.design,
            'digest': config.digest,
            'port': port,
            'serial_number': self._device.serial_number,
            'silent_s': '-' if sensor is None else f'{sensor.silent_s:.1f}',
        }
        status = DiagnosticStatus()
        status.name = f'{self.get_fully_qualified_name()}: {config.design}'
        status.hardware_id = self._device.serial_number or port
        status.level = bytes([found['level']])
        status.message = found['message']
        for key, value in found['values'].items():
            status.values.append(fields.filled(KeyValue(), {'key': key, 'value': value}))
        report = DiagnosticArray()
        report.header.stamp = self.get_clock().now().to_msg()
        report.status.append(status)
        self._status.publish(report)
        if not self._shown:
            self._mark_body()  # for RViz, if it was started after the node

    def _answer(self, response, work):
        sensor = self._sensor
        try:
            if sensor is None:
                raise OptopadError('the sensor is not open; activate the node')
            response.message, response.success = work(sensor), True
        except OptopadError as err:
            response.message, response.success = str(err), False
        return response

    def _take_baseline(self, request, response):
        def renewed(sensor):
            if sensor.fault:
                raise OptopadError(sensor.fault)
            self._renew.set()
            return 'taken from the next half second; leave the pad untouched'

        return self._answer(response, renewed)

    def _self_test(self, request, response):
        def tested(sensor):
            found = sensor.self_test()
            return ', '.join(f'{name} {value}' for name, value in vars(found).items())

        return self._answer(response, tested)

    def _record(self, request, response):
        def recorded(sensor):
            if self._recorder is not None:
                recorder, self._recorder = self._recorder, None
                recorder.close()
                if not request.file:
                    return f'{recorder.file}: {recorder.frames} frames'
            if not request.file:
                return 'nothing is recorded'
            self._recorder = sensor.record(request.file)
            return f'{request.file}: recording'

        return self._answer(response, recorded)


def main(args=None):
    """Run the node until it is interrupted or fails; return 1 if it failed."""
    rclpy.init(args=args)
    node = SensorNode()
    try:
        node.start()
        rclpy.spin_until_future_complete(node, node.failed)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.on_shutdown(None)
        node.destroy_node()
        rclpy.try_shutdown()
    return int(node.failed.done())


if __name__ == '__main__':
    sys.exit(main())
