"""A simulation that waits for its listeners: what they have had, and what is kept by it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from nodes_harness import Graph, overrides
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from wind_sensors.nodes.estimator_node import EstimatorNode
from wind_sensors.nodes.kinds import kind_for
from wind_sensors.nodes.quality import input_quality, output_quality
from wind_sensors.nodes.receipts import RECEIPTS_TOPIC, ReceiptBook, ReceiptSender
from wind_sensors.nodes.recorder import RecorderNode
from wind_sensors.nodes.simulator import SimulatorNode
from wind_sensors.recordings import load_station

PATIENT = 300.0
"""Longest wait in a test [s]: only a test that would never end reaches it."""


def _receipt(name: str, **counts: int) -> DiagnosticStatus:
    values = [KeyValue(key=f"/{topic}", value=str(n)) for topic, n in counts.items()]
    return DiagnosticStatus(name=name, values=values)


def test_nobody_is_waited_for_without_listeners() -> None:
    book = ReceiptBook(0)
    book.note_sent(1.0, {"/cup": 3})
    assert book.is_open
    assert book.complete_until == math.inf


def test_time_is_complete_when_the_slowest_listener_has_had_everything() -> None:
    book = ReceiptBook(2)
    book.note_sent(1.0, {"/cup": 3, "/vane": 20})
    book.note_sent(2.0, {"/cup": 6, "/vane": 40})
    book.note_received(_receipt("fast", cup=6, vane=40))
    assert not book.is_open
    assert book.complete_until == 0.0
    book.note_received(_receipt("slow", cup=3, vane=25))
    assert book.is_open
    assert book.complete_until == 1.0
    assert book.late_listeners == ["slow"]
    book.note_received(_receipt("slow", cup=6, vane=40))
    assert book.complete_until == 2.0
    assert book.late_listeners == []


def test_many_messages_of_one_topic_do_not_make_up_for_another() -> None:
    book = ReceiptBook(1)
    book.note_sent(1.0, {"/cup": 3, "/vane": 20})
    book.note_sent(2.0, {"/cup": 6, "/vane": 40})
    book.note_received(_receipt("burst", cup=2, vane=40))
    assert book.complete_until == 0.0


def test_topics_that_a_listener_does_not_name_are_not_asked_of_it() -> None:
    book = ReceiptBook(1)
    book.note_sent(1.0, {"/cup": 3, "/truth": 20})
    book.note_received(_receipt("estimator", cup=3, air=0))
    assert book.complete_until == 1.0
    assert book.listeners_of("/cup") == 1
    assert book.listeners_of("/truth") == 0


def test_standing_still_does_not_pile_up_notes() -> None:
    book = ReceiptBook(1)
    for _ in range(1000):
        book.note_sent(1.0, {"/cup": 3})
    assert len(book._sent) == 1


def test_simulated_time_stands_still_until_a_receipt_comes(graph: Graph) -> None:
    listener = graph.listener()
    counts = {"/cup/pulses": 0, "/vane/joint_states": 0}
    told = dict(counts)
    newest = {"/cup/pulses": 0.0, "/vane/joint_states": 0.0}

    def hear(topic: str, stamp: Any) -> None:
        counts[topic] += 1
        newest[topic] = max(newest[topic], stamp.sec + 1e-9 * stamp.nanosec)

    quality = input_quality(reliable=True, depth=100_000)
    listener.create_subscription(
        Header, "/cup/pulses", lambda m: hear("/cup/pulses", m.stamp), quality
    )
    listener.create_subscription(
        JointState, "/vane/joint_states", lambda m: hear("/vane/joint_states", m.header.stamp),
        quality,
    )
    sender = ReceiptSender(listener, lambda: told)
    simulator = graph.add(
        SimulatorNode,
        parameter_overrides=overrides(
            station="mast_cup_vane", speed=1000.0, duration=30.0, wait_for_receipts=1,
            longest_lead=2.0, output_depth=100_000, publish_clock=True,
        ),
    )
    graph.spin(lambda: simulator.elapsed == 2.0, PATIENT)
    for _ in range(200):
        graph.spin(lambda: True)
        for executor in graph._executors:
            executor.spin_once(timeout_sec=0.0)
    assert simulator.elapsed == 2.0
    sent = simulator.published_by_topic()
    graph.spin(lambda: all(counts[topic] == sent[topic] for topic in counts), PATIENT)

    told.update(counts)
    sender.send()
    graph.spin(lambda: simulator.elapsed > 2.0, PATIENT)
    assert simulator.elapsed <= 4.0
    assert not simulator.finished

    def follow() -> bool:
        told.update(counts)
        return bool(simulator.finished)

    graph.spin(follow, PATIENT)
    assert simulator.elapsed == 30.0


def test_the_simulation_does_not_begin_before_listeners_are_matched(graph: Graph) -> None:
    simulator = graph.add(
        SimulatorNode,
        parameter_overrides=overrides(
            station="mast_cup_vane", speed=10.0, wait_for_receipts=1, publish_clock=True
        ),
    )
    teller = graph.add(lambda **options: Node("teller", **options))
    outlet = teller.create_publisher(DiagnosticStatus, RECEIPTS_TOPIC, output_quality())
    graph.spin(lambda: outlet.get_subscription_count() == 1, PATIENT)
    outlet.publish(DiagnosticStatus(
        name="teller", values=[KeyValue(key="/truth/wind", value="0"),
                               KeyValue(key="/cup/pulses", value="0")],
    ))
    graph.spin(lambda: simulator._book.is_open, PATIENT)
    assert simulator._lonely_topics() == ["/cup/pulses"]
    teller.create_subscription(Header, "/cup/pulses", lambda _: None, input_quality(reliable=True))
    graph.spin(lambda: simulator.elapsed > 0.0, PATIENT)


def test_the_simulation_does_not_begin_before_the_results_have_their_listener(
    graph: Graph, tmp_path: Path
) -> None:
    station = load_station("mast_cup_vane")
    estimator = graph.add(
        EstimatorNode,
        kind=kind_for(station),
        parameter_overrides=overrides(
            station="mast_cup_vane", use_sim_time=True, reliable_inputs=True, send_receipts=True,
            wait_for_subscribers=1, silence=600.0,
        ),
    )
    simulator = graph.add(
        SimulatorNode,
        parameter_overrides=overrides(
            station="mast_cup_vane", speed=10.0, wait_for_receipts=1, publish_clock=True
        ),
    )
    graph.spin(lambda: not simulator._lonely_topics(), PATIENT)
    estimator._receipts.send()
    assert not estimator._receipts.has_begun and not simulator._book.is_open
    graph.add(RecorderNode, folder=tmp_path / "recording", topics=None, station=station)
    graph.spin(lambda: simulator.elapsed > 0.0, PATIENT)
