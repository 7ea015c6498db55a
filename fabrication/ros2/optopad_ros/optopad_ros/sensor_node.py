"""Publish frames and touches of an optical touch pad, as a lifecycle node."""

from pathlib import Path
from threading import Event
from threading import Thread

from design.errors import OptopadError
from diagnostic_msgs.msg import DiagnosticArray
from diagnostic_msgs.msg import DiagnosticStatus
from diagnostic_msgs.msg import KeyValue
from fabrication.driver import ros_fields as fields
from geometry_msgs.msg import TransformStamped
import optopad
from optopad_msgs.msg import Frame
from optopad_msgs.msg import Sensor
from optopad_msgs.msg import Touch
from optopad_msgs.srv import Record
import rclpy
from rclpy.lifecycle import LifecycleNode
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.qos import DurabilityPolicy
from rclpy.qos import QoSProfile
from std_srvs.srv import Trigger
from tf2_ros.static_transform_broadcaster import StaticTransformBroadcaster
from visualization_msgs.msg import Marker

PARAMETERS = {
    'config': '',
    'port': '',
    'model': '',
    'rate': -1.0,
    'frame_id': 'optopad',
    'patience': 3.0,
}
DIAGNOSTICS_S = 1.0
CLOSING_S = 5.0


class SensorNode(LifecycleNode):
    """
    Publish a sensor's frames, and the touches that a model finds in them.

    Topics: frame, touch, sensor (kept for late subscribers), marker, /diagnostics.
    Services: baseline, self_test, record.
    """

    def __init__(self, name='sensor', **options):
        super().__init__(name, **options)
        for parameter, value in PARAMETERS.items():
            self.declare_parameter(parameter, value)
        self._over = Event()
        self._renew = Event()
        self._thread = None
        self._sensor = None
        self._recorder = None
        self._fault = ''

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
        self._sensors = self.create_publisher(Sensor, 'sensor', kept)
        self._markers = self.create_publisher(Marker, 'marker', kept)
        self._status = self.create_publisher(DiagnosticArray, '/diagnostics', 10)
        self._services = [
            self.create_service(Trigger, 'baseline', self._take_baseline),
            self.create_service(Trigger, 'self_test', self._self_test),
            self.create_service(Record, 'record', self._record),
        ]
        self._transforms = StaticTransformBroadcaster(self)
        self._timer = self.create_timer(DIAGNOSTICS_S, self._report)
        self._describe()
        return TransitionCallbackReturn.SUCCESS

    def on_activate(self, state):
        """Open the sensor and publish in a thread of its own."""
        self._over.clear()
        self._fault = ''
        self._thread = Thread(target=self._run, name='optopad sensor node', daemon=True)
        self._thread.start()
        return super().on_activate(state)

    def on_deactivate(self, state):
        """Stop the sensor and close its port."""
        self._stop()
        return super().on_deactivate(state)

    def on_cleanup(self, state):
        """Remove topics and services."""
        self._stop()
        self.destroy_timer(self._timer)
        for service in self._services:
            self.destroy_service(service)
        publishers = (self._frames, self._touches, self._sensors, self._markers, self._status)
        for publisher in publishers:
            self.destroy_publisher(publisher)
        return TransitionCallbackReturn.SUCCESS

    def on_shutdown(self, state):
        """Stop the sensor."""
        self._stop()
        return TransitionCallbackReturn.SUCCESS

    def _value(self, name):
        return self.get_parameter(name).value

    def _open_files(self):
        if not self._value('config'):
            raise OptopadError('config: is empty; give the driver.toml of the sensor')
        where = Path(self._value('config'))
        inside = where / 'fabrication' / 'driver.toml'
        rate, model = self._value('rate'), self._value('model')
        self._frame_id = self._value('frame_id')
        self._device = optopad.Sensor(
            inside if where.is_dir() else where,
            self._value('port') or None,
            rate_hz=None if rate < 0.0 else rate,
            patience_s=self._value('patience'),
            gather_s=0.0,
            on_wait=self.get_logger().info,
        )
        self._model = optopad.load_model(model) if model else None
        if self._model is not None:
            optopad.TouchReader(self._device, self._model)  # refuses a model of another design

    def _describe(self):
        began_s = self.get_clock().now().nanoseconds / 1e9
        said = fields.sensor_message(self._device.config, began_s)
        said['header']['frame_id'] = self._frame_id
        self._sensors.publish(fields.filled(Sensor(), said))
        self._transforms.sendTransform(fields.filled(
            TransformStamped(), fields.top_frame(self._device.descriptor, self._frame_id)))
        self._mark(None, began_s)

    def _run(self):
        try:
            with self._device as sensor:
                self._sensor = sensor
                if self._model is None:
                    self._publish_frames(sensor)
                else:
                    self._publish_touches(sensor)
        except OptopadError as err:
            self._fault = str(err)
            self.get_logger().error(self._fault)
        finally:
            if not self._over.is_set():
                self._fault = self._fault or 'the thread that reads the sensor has ended'
            self._sensor = self._recorder = None

    def _publish_frames(self, sensor):
        for frame in sensor:
            self._publish_frame(frame)
            if self._over.is_set():
                return
            if self._renew.is_set():
                self._renew.clear()
                sensor.take_baseline()

    def _publish_touches(self, sensor):
        reader = optopad.TouchReader(sensor, self._model)
        was_touched = False
        for touch in reader:
            message = fields.touch_message(touch, self._frame_id)
            self._touches.publish(fields.filled(Touch(), message))
            self._publish_frame(touch.frame)
            if touch.is_touched or was_touched:
                self._mark(touch, touch.frame.began_s)
            was_touched = touch.is_touched
            if self._over.is_set():
                return
            if self._renew.is_set():
                self._renew.clear()
                reader.restart()

    def _publish_frame(self, frame):
        self._frames.publish(fields.filled(Frame(), fields.frame_message(frame, self._frame_id)))

    def _mark(self, touch, began_s):
        shown = fields.marker(self._device.descriptor, touch, self._frame_id, began_s)
        self._markers.publish(fields.filled(Marker(), shown))

    def _stop(self):
        self._over.set()
        if self._thread is not None:
            self._thread.join(self._value('patience') + CLOSING_S)
            self._thread = None

    def _report(self):
        sensor = self._sensor
        found = fields.diagnosis(
            None if sensor is None else sensor.counts,
            None if sensor is None else sensor.rate_hz,
            self._device.descriptor.required_rate_hz,
            self._fault,
        )
        status = DiagnosticStatus()
        status.name = f'{self.get_name()}: {self._device.config.design}'
        status.hardware_id = self._device.config.digest[:8]
        status.level = bytes([found['level']])
        status.message = found['message']
        for key, value in found['values'].items():
            status.values.append(fields.filled(KeyValue(), {'key': key, 'value': value}))
        report = DiagnosticArray()
        report.header.stamp = self.get_clock().now().to_msg()
        report.status.append(status)
        self._status.publish(report)

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
    """Run the node until it is interrupted."""
    rclpy.init(args=args)
    node = SensorNode()
    try:
        rclpy.spin(node)
    except KeyboardInterrupt:
        pass
    finally:
        node.on_shutdown(None)
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
