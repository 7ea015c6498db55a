"""The page's server: who is answered, and which messages are taken. A plain client stands for a browser."""

from __future__ import annotations

import contextlib
import logging
import math
import re
import socket
import time
import tracemalloc
from collections.abc import Callable, Iterator
from typing import Any

import msgspec
import pytest
import viser
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect
from websockets.sync.connection import Connection
from websockets.typing import Origin, Subprotocol

from optopad.design.errors import InputError
from optopad.design.preset import preset_text
from optopad.studio.design_file import DesignFile
from optopad.studio.session import Session
from optopad.studio.view.controls import BackgroundJobs
from optopad.studio.view.local_server import LARGEST_MESSAGE_B, LocalServer, local_server
from optopad.studio.view.page import Page
from optopad.studio.view.shapes import KINDS, LARGEST_B

VISER = Subprotocol(f"viser-v{viser.__version__}")
Message = dict[str, Any]
Said = Callable[[], str]


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    """A page that is drawn and does not work: what the browser asks for is done by `done`."""
    file = tmp_path_factory.mktemp("studio") / "pads" / "pad.toml"
    file.parent.mkdir()
    file.write_text(preset_text("piacenza2017-pair"), encoding="utf-8")
    found = Page(Session(DesignFile(str(file))), out=file.parent / "outputs", port=0)
    found._draw()
    yield found
    found.close()


@pytest.fixture
def said(capfd: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture) -> Iterator[Said]:
    """Gives what was written to standard error since it was last called; at the end, nothing may be left or logged."""
    yield lambda: capfd.readouterr().err
    assert capfd.readouterr().err == ""
    assert [record.getMessage() for record in caplog.records if record.levelno >= logging.WARNING] == []


def done(page: Page) -> None:
    """Do on this thread what the page would do on its own."""
    page._do_what_is_due(math.inf)
    page._draw()


# --- who is answered


def asked(server: LocalServer, host: str, path: str, *more: str) -> tuple[int, str]:
    """Status and body of an answer to a request of these lines, `PORT` and `TOKEN` filled in."""
    port = str(server.get_port())
    lines = [f"GET {path} HTTP/1.1", *([f"Host: {host}"] if host else []), *more, "", ""]
    text = "\r\n".join(lines).replace("PORT", port).replace("TOKEN", server.token)
    with socket.create_connection(("127.0.0.1", int(port)), timeout=10) as line:
        line.sendall(text.encode())
        answer = line.makefile("rb")
        status = int(answer.readline().split()[1])
        return status, "" if status == 101 else answer.read().partition(b"\r\n\r\n")[2].decode()


HANDSHAKE = (
    "Connection: Upgrade",
    "Upgrade: websocket",
    "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
    "Sec-WebSocket-Version: 13",
    f"Sec-WebSocket-Protocol: {VISER}",
)
UPGRADES = {"page": (), "websocket": HANDSHAKE, "odd websocket": ("Upgrade: WebSocket", *HANDSHAKE)}
HERE, OURS = "127.0.0.1:PORT", "Origin: http://127.0.0.1:PORT"


@pytest.mark.parametrize("host", [HERE, "localhost:PORT", "LOCALHOST:PORT", "[::1]:PORT"])
@pytest.mark.parametrize("with_origin", [True, False])
def test_the_page_itself_and_a_program_with_the_token_are_answered(
    page: Page, host: str, with_origin: bool, said: Said
) -> None:
    origin = [f"Origin: http://{host.lower()}".replace("port", "PORT")] if with_origin else []
    for path in ("/TOKEN", "/TOKEN/", "/TOKEN/?fixedDpr=1", "/TOKEN/index.html"):
        status, body = asked(page.server, host, path, *origin)
        assert status == 200
        assert "<title>Viser</title>" in body
    assert asked(page.server, host, "/TOKEN", *origin, *HANDSHAKE)[0] == 101


FOREIGN_HOSTS = """evil.example:PORT evil.example 127.0.0.1 127.0.0.1:1 127.0.0.2:PORT 0.0.0.0:PORT localhost.:PORT
    127.0.0.1:PORT.evil.example user@127.0.0.1:PORT"""
FOREIGN_ORIGINS = """http://evil.example http://evil.example:PORT null file:// http://127.0.0.1 http://127.0.0.1:1
    https://127.0.0.1:PORT http://localhost:PORT http://127.0.0.1:PORT.evil.example"""
WRONG_PATHS = "/ /index.html /TOKENx/ /x/TOKEN/ /?token=TOKEN //TOKEN/ /%54/ /é/"
FOREIGN: list[tuple[str, str, tuple[str, ...], str]] = [
    *[(host, "/TOKEN/", (), "^Host ") for host in [*FOREIGN_HOSTS.split(), ""]],
    (HERE, "/TOKEN/", ("Host: evil.example:PORT",), "refused: the studio"),
    *[(HERE, "/TOKEN/", (f"Origin: {one}",), "^Origin .* is refused: ") for one in FOREIGN_ORIGINS.split()],
    (HERE, "/TOKEN/", (OURS, "Origin: http://evil.example"), "studio's own page"),
    *[(HERE, path, (), "^No or a wrong token") for path in WRONG_PATHS.split()],
    *[(HERE, path, (OURS,), "^No or a wrong token") for path in WRONG_PATHS.split()],
]


@pytest.mark.parametrize("upgrade", UPGRADES)
@pytest.mark.parametrize(("host", "path", "more", "words"), FOREIGN)
def test_whoever_else_asks_is_refused_before_viser_sees_it(
    page: Page, upgrade: str, host: str, path: str, more: tuple[str, ...], words: str, said: Said
) -> None:
    status, body = asked(page.server, host, path, *more, *UPGRADES[upgrade])
    assert status == 403
    assert re.search(words, body)
    assert page.server.token not in body


def test_a_token_is_random_and_long_and_part_of_the_address(page: Page) -> None:
    other = local_server(0)
    try:
        assert other.token != page.server.token
        assert asked(other, HERE, f"/{page.server.token}/")[0] == 403
    finally:
        other.stop()
    assert re.fullmatch(r"http://127\.0\.0\.1:\d+/[\w-]{32}/", page.url)


def test_nothing_is_said_of_bytes_that_are_no_request(page: Page, said: Said) -> None:
    for noise in (b"\x16\x03\x01\x02\x00\x01\x00", b"\r\n\r\n", b"POST / HTTP/1.1\r\n\r\n", b""):
        with socket.create_connection(("127.0.0.1", page.server.get_port()), timeout=10) as line:
            line.sendall(noise)
            line.shutdown(socket.SHUT_WR)
            while line.recv(4096):
                pass


def test_a_viser_whose_requests_cannot_be_checked_serves_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    ports: list[int] = []
    stop = LocalServer.stop

    def stopped(server: LocalServer) -> None:
        ports.append(server.get_port())
        stop(server)

    monkeypatch.setattr(LocalServer, "_checked", lambda _: contextlib.nullcontext())
    monkeypatch.setattr(LocalServer, "stop", stopped)
    with pytest.raises(InputError, match="studio cannot check"):
        local_server(0)
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.1", ports[0]), timeout=10)


# --- which messages are taken


@contextlib.contextmanager
def line_to(page: Page) -> Iterator[Connection]:
    """The websocket as the page opens it."""
    address, ours = page.url.replace("http://", "ws://").rstrip("/"), page.url[:-1].rpartition("/")[0]
    with connect(address, subprotocols=[VISER], origin=Origin(ours), proxy=None, max_size=None) as line:
        yield line


def value_set(handle: Any, value: object) -> Message:
    return {"type": "GuiUpdateMessage", "uuid": handle._impl.uuid, "updates": {"value": value}}


def rightly(page: Page) -> dict[str, Message]:
    """A right message of every kind."""
    way = {
        "ray_origin": [*page.session.press.place_mm, 60],
        "ray_direction": [0.0, 0.1, -10],
        "modifier": None,
    }
    spots = {"start_position": [1.5, 0, 4], "end_position": [2.5, 0.0, 4.5]}
    screen = {"start_screen_pos": [0.5, 0.5], "end_screen_pos": [0.6, 0.5]}
    turned = {"wxyz": [1.0, 0.0, 0, 0], "up_direction": [0, 0, 1.0], "look_at": [16, 16, 4]}
    lens = {"fov": 1.3, "near": 0.01, "far": 1000, "image_height": 800, "image_width": 1300}
    part = {"name": "/parts/E1/face", "instance_index": None, "modifier": None, "owner": ""}
    return {
        "ViewerCameraMessage": {"position": [5.0, -40, 30]} | turned | lens,
        "CommandTriggerMessage": {"uuid": next(iter(page.server.gui._command_handle_from_uuid))},
        "GetRenderResponseMessage": {"payload": b"PNG", "render_uuid": "1"},
        "GuiUpdateMessage": value_set(page._controls._name, "pad.toml"),
        "SceneNodeClickMessage": part | way | {"screen_pos": [0.5, 0.5]},
        "SceneNodeDragMessage": part | spots | screen | {"phase": "start", "button": "left"},
        "ScenePointerMessage": way | {"event_type": "click", "screen_pos": [[0.5, 0.5]]},
    }


def sent(line: Connection, name: str, message: Message) -> None:
    line.send(msgspec.msgpack.encode(message | {"type": name}))


def heard(page: Page, line: Connection) -> None:
    """Wait until the messages sent so far were handled."""
    mark = f"pad{time.monotonic_ns()}.toml"
    sent(line, "GuiUpdateMessage", value_set(page._controls._name, mark))
    until = time.monotonic() + 20
    while page._controls.file_name != mark:
        assert time.monotonic() < until
        time.sleep(0.005)
    time.sleep(0.02)  # callbacks on viser's threads


def require_refused(page: Page, raw: bytes | str, said: Said, words: str, code: int = 1008) -> None:
    """One line on standard error, and the connection ends."""
    with line_to(page) as line:
        with contextlib.suppress(ConnectionClosed):
            line.send(raw)
        with contextlib.suppress(ConnectionClosed):
            while True:
                line.recv(timeout=20)
        assert line.close_code == code
    until = time.monotonic() + 20
    while not (text := said()):  # of a message that is too large it is written after the end
        assert time.monotonic() < until
        time.sleep(0.005)
    (line_said,) = text.splitlines()
    assert re.match(f"studio: .* refused: .*{words}", line_said)


def test_a_right_message_of_every_kind_is_taken(page: Page, said: Said) -> None:
    messages = rightly(page)
    assert messages.keys() == KINDS.keys()
    with line_to(page) as line:
        for name, message in messages.items():
            sent(line, name, message)
        for phase in ("update", "end"):
            sent(line, "SceneNodeDragMessage", messages["SceneNodeDragMessage"] | {"phase": phase})
        heard(page, line)
    assert page._todo.keys() >= {"move E1", "/tip"}
    done(page)


ODD: tuple[Any, ...] = (
    *(
        None,
        True,
        0,
        -1,
        7,
        2**63,
        0.5,
        math.nan,
        math.inf,
        1e9,
        -1e300,
        "",
        "x",
        "/",
        "é" * 50,
        b"",
        b"\xff",
    ),
    *(
        [],
        [0, 0],
        [0, 0, 0],
        [0.0] * 4,
        [[0, 0]],
        [None] * 3,
        ["a", "b", "c"],
        [math.nan] * 3,
        [1e9] * 3,
        [[]],
    ),
    *({}, {"value": 1}, {"value": "x"}, {"value": None}, {"update_cb": []}, {"removed": True}, {1: 2}),
    *(
        "start",
        "click",
        "update",
        "end",
        "left",
        "shift",
        "rect-select",
        "/tip/body",
        "/parts/E1/body",
        "/pad/top",
    ),
)


@pytest.mark.slow
@pytest.mark.parametrize("name", KINDS)
def test_whatever_a_field_holds_there_is_no_traceback(page: Page, name: str, said: Said) -> None:
    right = rightly(page)[name] | {"type": name}
    mutants = [right | {field: odd} for field in [*right, "excluded_self_client", "more"] for odd in ODD]
    mutants += [{key: right[key] for key in right if key != field} for field in right]
    raws = [msgspec.msgpack.encode(one) for one in mutants]
    faults = [page.server.fault_of(raw) for raw in raws]
    assert [fault for fault in faults if fault is not None and (len(fault) > 500 or "\n" in fault)] == []
    with line_to(page) as line:
        sent(line, "ViewerCameraMessage", rightly(page)["ViewerCameraMessage"])
        for raw, fault in zip(raws, faults, strict=True):
            if fault is None:
                line.send(raw)
                heard(page, line)
                page._do_what_is_due(math.inf)
        sent(line, "ViewerCameraMessage", rightly(page)["ViewerCameraMessage"])
        heard(page, line)
    wrong = sum(fault is not None for fault in faults)
    assert wrong > 0.7 * len(mutants)
    require_refused(page, raws[[fault is not None for fault in faults].index(True)], said, "")


@pytest.mark.parametrize(
    ("raw", "words"),
    [
        ("text", "where a message"),
        (b"", "0 bytes"),
        (b"\xc1", "1 bytes"),
        (b"\xa1\xff", "2 bytes"),
        (b"\x91" * 50_000, "50000 bytes"),
        (msgspec.msgpack.encode([1, 2]), "None is"),
        (msgspec.msgpack.encode({}), "None is"),
        (msgspec.msgpack.encode({"type": ["x"]}), r"type \['x'\] is not one of"),
        (msgspec.msgpack.encode({"type": "x" * 10_000}), "type 'x{1,60} is not one of"),
    ],
)
def test_what_is_no_message_is_refused_in_one_line(
    page: Page, raw: bytes | str, words: str, said: Said
) -> None:
    require_refused(page, raw, said, words)


def test_every_other_kind_of_viser_is_refused(page: Page, said: Said) -> None:
    others = viser.infra.Message._subclass_from_type_string().keys() - KINDS.keys()
    assert {
        "FileTransferStartUpload",
        "GuiFormDirtyMessage",
        "ShareUrlRequest",
        "RunJavascriptMessage",
    } <= others
    faults = [page.server.fault_of(msgspec.msgpack.encode({"type": name})) for name in others]
    assert [fault for fault in faults if fault is None or "is not one of" not in fault] == []


def test_every_field_and_button_takes_values_of_its_kind_alone(page: Page, said: Said) -> None:
    handles = page.server.gui._gui_input_handle_from_uuid
    assert len(handles) > 20
    seen = set()
    for handle in handles.values():
        for odd in ODD:
            fault = page.server.fault_of(msgspec.msgpack.encode(value_set(handle, odd)))
            is_number = isinstance(odd, float | int) and not isinstance(odd, bool)
            fits = isinstance(odd, str) if isinstance(handle.value, str) else isinstance(odd, bool)
            if isinstance(handle.value, float | int) and not isinstance(handle.value, bool):
                fits = is_number and abs(odd) <= 1e9
            if hasattr(handle, "options"):
                fits = odd in handle.options
            assert (fault is None) == fits, (handle.label, odd, fault)
            seen.add((type(handle).__name__, fits))
    assert {name for name, fits in seen if not fits} == {type(handle).__name__ for handle in handles.values()}


# --- large messages


def test_a_message_that_is_too_large_is_refused_in_one_line(page: Page, said: Said) -> None:
    text = msgspec.msgpack.encode(value_set(page._controls._name, "x" * LARGEST_B))
    require_refused(
        page, text, said, f"GuiUpdateMessage: {len(text)} bytes, where at most {LARGEST_B} are taken"
    )
    require_refused(
        page, bytes(LARGEST_MESSAGE_B + 1), said, f"it is larger than {LARGEST_MESSAGE_B} bytes", code=1009
    )


@pytest.mark.slow
def test_memory_returns_after_large_messages(page: Page, said: Said) -> None:
    picture = msgspec.msgpack.encode(
        {"type": "GetRenderResponseMessage", "payload": bytes(12 * 2**20), "render_uuid": "none asked for"}
    )
    text = msgspec.msgpack.encode(value_set(page._controls._name, "x" * 12 * 2**20))
    tracemalloc.start()
    try:
        with line_to(page) as line:
            heard(page, line)
            before, _ = tracemalloc.get_traced_memory()
            for _ in range(5):
                line.send(picture)
        with line_to(page) as line:
            heard(page, line)
        for _ in range(3):
            require_refused(page, text, said, "GuiUpdateMessage")
        until = time.monotonic() + 10
        while (now := tracemalloc.get_traced_memory()[0]) > before + 2 * 2**20 and time.monotonic() < until:
            time.sleep(0.05)
    finally:
        tracemalloc.stop()
    assert now < before + 2 * 2**20


# --- what the page may write


@pytest.mark.parametrize("name", ["../out.toml", "/out.toml", "con.toml", "in\\out.toml"])
def test_the_page_saves_in_the_folder_of_the_design_alone(page: Page, name: str, said: Said) -> None:
    folder = page.session.file.folder
    before = sorted(folder.parent.rglob("*"))
    buttons = next(
        one
        for one in page.server.gui._gui_input_handle_from_uuid.values()
        if "Save" in getattr(one, "options", ())
    )
    with line_to(page) as line:
        sent(line, "ViewerCameraMessage", rightly(page)["ViewerCameraMessage"])
        sent(line, "GuiUpdateMessage", value_set(page._controls._name, name))
        sent(line, "GuiUpdateMessage", value_set(buttons, "Save"))
        until = time.monotonic() + 20
        while "button Save" not in page._todo:
            assert time.monotonic() < until
            time.sleep(0.005)
    while page.session.can_undo:
        page.session.undo()
    page._do_what_is_due(math.inf)
    assert "my-pad.toml" in page.session.said.text
    assert sorted(folder.parent.rglob("*")) == before


def test_a_picture_that_does_not_come_is_told_in_the_page(
    page: Page, monkeypatch: pytest.MonkeyPatch, said: Said
) -> None:
    monkeypatch.setattr("optopad.studio.view.controls.PICTURE_S", 0.05)
    with line_to(page) as line:
        sent(line, "ViewerCameraMessage", rightly(page)["ViewerCameraMessage"])
        heard(page, line)
        buttons = BackgroundJobs(
            page.server, page.session, page._task, changed=lambda: None, found=lambda _: None
        )
        buttons.export_picture()
    assert page.session.said.is_bad
    assert "Render" in page.session.said.text
