# SPDX-License-Identifier: Apache-2.0
"""The node: publishers, subscriptions, services, actions and parameters of one board.

Everything here is wiring. Callbacks run in the executor's thread, one at a time; what they do
with the board they do between two control cycles (``loop.exclusive``).
"""

from __future__ import annotations

import traceback
from collections.abc import Callable
from typing import Any

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node

from ..compiled import describe, is_compiled
from ..core.board import Board
from ..core.config import BoardConfig
from ..core.measurement import Plant
from ..interface import DIAGNOSTICS, SERVICES, Endpoint
from .actions import Actions
from .command_subscription import CommandSubscription
from .diagnostics import Diagnostics
from .follow_trajectory import FollowTrajectory
from .loop import ControlLoop
from .messages import stamp
from .parameters import Parameters, Start
from .publishing import StatePublisher, publisher
from .scheduling import take_priority
from .services import Services
from .throttle import PERIOD, ThrottledLog, writers
from .topics import CommandTopics
from .trajectory import TrajectoryTopic
from .transforms import offer_transforms

#: s after the start at which the graph is known well enough to look for another node of this name.
SETTLED = 3.0


class BoardNode:
    """One board on ROS. Make it, :meth:`start` it, spin ``node``, :meth:`stop` it.

    Args:
        start: settings and what rclpy needs of the command line.
        plant: what the board drives; closed at the end.
        on_end: called when the control loop ends by itself; ``loop.failure`` says why.
        context: of rclpy; None for the default one.
    """

    def __init__(
        self,
        start: Start,
        plant: Plant,
        *,
        on_end: Callable[[], None] = lambda: None,
        context: Any = None,
    ) -> None:
        settings = start.settings
        values, simulated = settings.values, bool(settings.ros.get("use_sim_time", False))
        self.board = Board(settings.board)
        self.loop = ControlLoop(
            self.board,
            plant,
            state_rate=values["state_rate"],
            real_time_factor=values["real_time_factor"],
            simulated_stamps=values["publish_clock"] or simulated,
            on_end=on_end,
        )
        self.node = Node(
            "control_board", context=context, parameter_overrides=list(start.overrides)
        )
        self.log = self.node.get_logger()
        self._throttled = ThrottledLog()
        self._write = writers(self.log)
        self.parameters = Parameters(self.node, settings, self._reconfigure, self._changed)
        names = settings.board.names
        self.publisher = StatePublisher(
            self.node, self.loop, names, settings.description, self._log_events, self.on_error
        )
        offer_transforms(self.node, self.loop, self.publisher, settings)
        injection = bool(values["allow_fault_injection"])
        self._trajectories = TrajectoryTopic(self.loop, self.warn)
        self._services = Services(
            self.loop, plant, injection, self._later, self._trajectories.follower
        )
        self._offer_services()
        commands = CommandTopics(
            self.loop,
            plant,
            injection=injection,
            joint_trajectory=self._trajectories.on_message,
            warn=self.warn,
        )
        self._subscriptions = self._subscribe(commands)
        self._actions = Actions(self.node, self.loop, self.warn)
        self._follow_trajectory = FollowTrajectory(
            self.node, self.loop, self._trajectories.follower, self.on_error
        )
        self._diagnostics = Diagnostics(
            self.loop,
            names,
            settings.urdf.name,
            settings.board.control_rate,
            [joint.limits.temperature for joint in settings.board.joints],
        )
        self._diagnostics_publisher = publisher(self.node, DIAGNOSTICS)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.node.create_timer(PERIOD, self._each_second, clock=steady)
        self._same_name_timer = self.node.create_timer(
            SETTLED, self._warn_of_same_name, clock=steady
        )
        for warning in settings.warnings:
            self.log.warning(warning)
        for note in settings.notes:
            self.log.info(note)
        if not is_compiled():
            self.log.warning(f"laws: {describe()}")
        if simulated:
            self.log.info("use_sim_time: stamps are simulated time; this board publishes /clock")
        if self.loop.state_rate != values["state_rate"]:
            self.log.warning(
                f"state_rate {values['state_rate']:g} Hz is above control_rate; "
                f"{self.loop.state_rate:g} Hz is in force, one state per control cycle"
            )

    def start(self) -> None:
        """Let the control loop and the publisher run."""
        self.loop.start()
        self.publisher.start()

    def stop(self) -> bool:
        """Joints unpowered, last state published; false if the control loop hangs."""
        stopped = self.loop.stop()
        self.publisher.stop(timeout=0.5)
        return stopped

    def warn(self, message: str, what: str = "ignored") -> None:
        """Log a warning, once per second and cause; repeats are counted as ``what``."""
        self._throttled.say(self._write["warning"], message, what)

    def on_error(self, error: Exception, where: str) -> None:
        """An exception that should not be: one line, once per second and cause."""
        frames = traceback.extract_tb(error.__traceback__)
        at = f" ({frames[-1].filename}:{frames[-1].lineno})" if frames else ""
        text = str(error).partition("\n")[0]
        self._throttled.say(
            self._write["error"],
            f"internal error in {where}: {type(error).__name__}: {text}{at}; please report it",
            what="times",
        )

    # -- wiring -------------------------------------------------------------------------------

    def _offer_services(self) -> None:
        for service in SERVICES:
            callback = self._answering(service, getattr(self._services, service.short))
            self.node.create_service(
                service.load(), service.name, callback, qos_profile=service.qos.profile()
            )

    def _answering(self, service: Endpoint, callback: Any) -> Any:
        """A service's callback that always answers, and never raises."""
        name, kind = service.short, service.load()

        def answer(request: Any, response: Any) -> Any:
            try:
                return callback(request, response)
            except ValueError as error:
                return kind.Response(success=False, message=str(error))
            except Exception as error:  # noqa: BLE001 - no callback ends the node
                self.on_error(error, name)
                return kind.Response(
                    success=False, message=f"internal error in {name}; the board's log tells more"
                )

        return answer

    def _subscribe(self, commands: CommandTopics) -> list[CommandSubscription]:
        return [
            CommandSubscription(self.node, topic, self._guarded(topic.short, callback))
            for topic, callback in commands.callbacks().items()
        ]

    def _guarded(self, name: str, callback: Callable[[Any], None]) -> Callable[[Any], None]:
        """A topic's callback that never raises."""

        def take(message: Any) -> None:
            try:
                callback(message)
            except ValueError as error:
                self.warn(f"{name} ignored: {error}")
            except Exception as error:  # noqa: BLE001 - no callback ends the node
                self.on_error(error, name)

        return take

    def _later(self, function: Callable[[], None]) -> None:
        executor = self.node.executor
        if executor is not None:
            executor.create_task(function)

    # -- parameters ---------------------------------------------------------------------------

    def _reconfigure(self, config: BoardConfig) -> None:
        with self.loop.exclusive() as board:
            board.reconfigure(config)

    def _changed(self, name: str, value: Any) -> None:
        if name == "state_rate":
            self.loop.set_state_rate(value)
        elif name == "real_time_factor":
            parting = value != 1.0 and self.loop.time_base.follows_system
            self.loop.set_real_time_factor(value)
            take_priority(self.parameters.settings.values)
            if parting:
                self.publisher.announce_clock()
                self.log.info(
                    "stamps go on from where they are with simulated time, for good, and /clock "
                    "tells it; start nodes that compare times with use_sim_time:=true"
                )

    # -- now and then -------------------------------------------------------------------------

    def _log_events(self) -> None:
        """Log what happened in the control cycles (in the publisher's thread)."""
        events = self.loop.snapshots.events
        while events:
            event = events.popleft()
            write = self._write[event.level]
            self._throttled.say(write, event.text, what="times", cause=event.key + event.joint)

    def _each_second(self) -> None:
        self._throttled.flush()
        now = stamp(self.loop.snapshots.now())
        self._diagnostics_publisher.publish(self._diagnostics.message(now))
        for subscription in self._subscriptions:
            subscription.check()

    def _warn_of_same_name(self) -> None:
        self._same_name_timer.cancel()
        name = self.node.get_fully_qualified_name()
        same = [
            1
            for node, namespace in self.node.get_node_names_and_namespaces()
            if f"{namespace.rstrip('/')}/{node}" == name
        ]
        if len(same) > 1:
            self.log.warning(
                f"{len(same)} nodes are called {name} on this domain, and each executes every "
                "request; stop the others (ros2 node list), or use another name or ROS_DOMAIN_ID"
            )
