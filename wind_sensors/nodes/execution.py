"""Start, spin and stop: the one helper behind every executable and `wind` command that uses rclpy.

Nothing heavy is imported at module level, so that an interrupt is answered with exit status 0 from
the first moment, even while the libraries are still loading.
"""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from enum import Enum, auto
from importlib import import_module
from types import FrameType, TracebackType
from typing import TYPE_CHECKING, Any

from wind_sensors.errors import UserError

if TYPE_CHECKING:
    from rclpy.context import Context
    from rclpy.executors import Executor
    from rclpy.node import Node

_WAKE_UP_PERIOD = 0.5
_WINDING_UP = 4.0
"""After a stop signal [s]; launchers send a harder one after five."""


class _Stopped(BaseException):
    """A stop signal arrived while the nodes were being built."""


class _Phase(Enum):
    """What a stop signal means at present."""

    LOADING = auto()
    BUILDING = auto()
    RUNNING = auto()


class _StopSignals:
    """One handler for the whole life of the process.

    rclpy installs none: its own would end the context under a callback that publishes, and the
    executor prints what that leads to before anybody can catch it.

    Attributes:
        phase: What a signal means at present.
        stopped: One has arrived; the running callback is the last one.
    """

    def __init__(self) -> None:
        self.phase = _Phase.LOADING
        self.stopped = False
        self._installed = False
        self._usual_unraisable = sys.unraisablehook
        self._usual_printed = sys.excepthook

    def install(self) -> None:
        """Answer SIGINT and SIGTERM; to be called from the main thread, before rclpy.init."""
        if not self._installed:
            for number in (signal.SIGINT, signal.SIGTERM):
                signal.signal(number, self._answer)
            if sys.unraisablehook is not _unraisable:
                self._usual_unraisable = sys.unraisablehook
                sys.unraisablehook = _unraisable
            if sys.excepthook is not _printed:
                self._usual_printed = sys.excepthook
                sys.excepthook = _printed
            self.stopped = False
            self._installed = True

    def report_unraisable(self, unraisable: sys.UnraisableHookArgs) -> None:
        """What an exception leads to that nobody can catch: a stop signal, to nothing.

        It may arrive within a destructor, where Python drops what is raised; `stopped` ends the
        run as soon as the nodes are built then.
        """
        if not issubclass(unraisable.exc_type, _Stopped):
            self._usual_unraisable(unraisable)

    def report_printed(
        self, kind: type[BaseException], error: BaseException, trace: TracebackType | None
    ) -> None:
        """What compiled code prints and answers with an error of its own: a stop signal, nothing.

        Libraries do so when an import within them is interrupted.
        """
        if not issubclass(kind, _Stopped):
            self._usual_printed(kind, error, trace)

    def uninstall(self, *, ignore: bool) -> None:
        """Hand SIGINT and SIGTERM back to Python's defaults, or to nobody.

        Args:
            ignore: The process is about to end, so that a signal must not spoil its exit status
                while the interpreter closes down.
        """
        interrupt = signal.SIG_IGN if ignore else signal.default_int_handler
        signal.signal(signal.SIGINT, interrupt)
        signal.signal(signal.SIGTERM, signal.SIG_IGN if ignore else signal.SIG_DFL)
        self._installed = False
        self.phase = _Phase.LOADING

    def hand_back(self) -> None:
        """Leave SIGINT and SIGTERM to Python, unless a run has handed them on already."""
        if self._installed:
            self.uninstall(ignore=False)

    def _answer(self, number: int, frame: FrameType | None) -> None:
        if self.phase is _Phase.LOADING:
            # Nothing has been opened yet, so there is nothing to close.
            os._exit(0)
        self.stopped = True
        if self.phase is _Phase.BUILDING and not _is_reporting(frame):
            raise _Stopped


_stop_signals = _StopSignals()


@contextmanager
def stop_signals_answered() -> Iterator[None]:
    """End with status 0 at SIGINT and SIGTERM from here on, while libraries load and after it.

    For a command that calls `run` inside; to be entered from the main thread, before anything is
    open that must be closed.
    """
    _stop_signals.install()
    try:
        yield
    finally:
        _stop_signals.hand_back()


def _unraisable(unraisable: sys.UnraisableHookArgs) -> None:
    _stop_signals.report_unraisable(unraisable)


def _printed(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    _stop_signals.report_printed(kind, error, trace)


def _is_reporting(frame: FrameType | None) -> bool:
    """Whether a hook for what nobody can catch is running, out of which nothing may be raised."""
    hooks = (_unraisable.__code__, _printed.__code__)
    while frame is not None and frame.f_code not in hooks:
        frame = frame.f_back
    return frame is not None


def execute(target: str, arguments: Sequence[str] | None = None) -> int:
    """Run one executable: import it, build its nodes, spin until told to stop.

    Args:
        target: `module:function`; the function takes the command line without the program's name
            and returns the nodes to spin. It may print and raise SystemExit (for `--help`).
        arguments: Command line without the program's name; None: the process's own.

    Returns:
        Exit status: 0 after SIGINT or SIGTERM at any moment, 2 after a mistake of the user.
    """
    _stop_signals.install()
    module, _, function = target.partition(":")
    given = list(sys.argv[1:] if arguments is None else arguments)
    build: Callable[[list[str]], Sequence[Node]] = getattr(import_module(module), function)
    try:
        return run(lambda: build(given), given)
    except UserError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2


def run(
    build: Callable[[], Sequence[Node]],
    arguments: Sequence[str] | None = None,
    *,
    until: Callable[[], bool] | None = None,
    wind_up: Callable[[], bool] | None = None,
    last: bool = True,
) -> int:
    """Initialise rclpy, build nodes, spin them in one executor, and clean up.

    SIGINT (also twice, as under a launcher) and SIGTERM end it with status 0, whether the nodes
    are being built, spinning or closing. Call it from the main thread.

    Args:
        build: Makes the nodes; called after `rclpy.init`.
        arguments: Command line that may hold `--ros-args`.
        until: Asked after each batch of callbacks, at least twice a second; True ends the run.
        wind_up: Asked in the same way after a stop signal that finds the nodes spinning: they
            spin on until it is True, four seconds at the most. None: a signal ends the run.
        last: The process ends after this, so further stop signals are ignored.

    Returns:
        Exit status 0.

    Raises:
        UserError: A mistake of the user, or no rclpy.
    """
    try:
        import rclpy
        from rclpy.exceptions import ParameterException
        from rclpy.executors import ExternalShutdownException
    except ImportError as error:
        raise UserError(
            f"live topics need rclpy, which cannot be imported ({error}).",
            remedy="Source a ROS 2 installation, or use the virtual environment that "
            "`make test` builds.",
        ) from None

    nodes: list[Node] = []
    executor: Executor | None = None
    _stop_signals.install()
    try:
        _initialise(arguments)
        _stop_signals.phase = _Phase.BUILDING
        nodes.extend(build())
        _tell_unknown_parameters(nodes)
        executor = make_executor()
        for node in nodes:
            executor.add_node(node)
        _stop_signals.phase = _Phase.RUNNING
        while rclpy.ok() and not _stop_signals.stopped and not (until is not None and until()):
            # A signal that finds nothing to do is answered when this returns.
            executor.spin_once(timeout_sec=_WAKE_UP_PERIOD)
        end = time.monotonic() + _WINDING_UP
        while _stop_signals.stopped and wind_up is not None and rclpy.ok():
            if wind_up() or time.monotonic() >= end:
                break
            executor.spin_once(timeout_sec=_WAKE_UP_PERIOD)
    except (_Stopped, KeyboardInterrupt, ExternalShutdownException):
        pass
    except ParameterException as error:
        raise UserError(f"{error}.", "parameters") from error
    except Exception as error:
        # What is raised while a class is being made, Python 3.11 hands on as an error of its own.
        interrupted = _stop_signals.stopped and _stop_signals.phase is _Phase.BUILDING
        if not interrupted and (rclpy.ok() or not _is_consequence_of_shutdown(error)):
            raise
    finally:
        _stop_signals.phase = _Phase.RUNNING
        if executor is not None:
            executor.shutdown()
        for node in reversed(nodes):
            node.destroy_node()
        rclpy.try_shutdown()
        _stop_signals.uninstall(ignore=last)
    return 0


def _tell_unknown_parameters(nodes: Sequence[Node]) -> None:
    """Warn of parameters that no node of the process has declared, each once."""
    from wind_sensors.nodes.parameters import unknown_parameters, unknown_text

    told: set[str] = set()
    for node in nodes:
        for name, nearest in unknown_parameters(node, nodes).items():
            if name not in told:
                told.add(name)
                node.get_logger().warning(unknown_text(name, nearest))


def _initialise(arguments: Sequence[str] | None) -> None:
    import rclpy
    from rclpy.impl.implementation_singleton import rclpy_implementation
    from rclpy.signals import SignalHandlerOptions

    try:
        rclpy.init(
            args=None if arguments is None else list(arguments),
            signal_handler_options=SignalHandlerOptions.NO,
        )
    except (
        rclpy_implementation.RCLError,
        rclpy_implementation.RCLInvalidROSArgsError,
        rclpy_implementation.UnknownROSArgsError,
    ) as error:
        raise UserError(
            "The arguments after --ros-args cannot be understood.",
            remedy=f"rcl says: {str(error).splitlines()[0]}",
        ) from error


def _is_consequence_of_shutdown(error: Exception) -> bool:
    """Whether rclpy raises such an error when its context ends under a running call."""
    from rclpy.exceptions import InvalidHandle, NotInitializedException
    from rclpy.impl.implementation_singleton import rclpy_implementation

    return isinstance(
        error, (rclpy_implementation.RCLError, InvalidHandle, NotInitializedException)
    )


def make_executor(context: Context | None = None) -> Executor:
    """The fastest executor of the installed rclpy: events where it has them, else one thread."""
    from rclpy.executors import SingleThreadedExecutor

    try:
        events: Any = import_module("rclpy.experimental")
    except ImportError:
        return SingleThreadedExecutor(context=context)
    executor: Executor = events.EventsExecutor(context=context)
    return executor
