# SPDX-License-Identifier: Apache-2.0
"""I: interaction modes and impedance."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from control_board_ros.client import State
from control_board_ros.core.terms.vocabs import InteractionMode
from control_board_ros.interface import GET_IMPEDANCE, SET_IMPEDANCE, SET_INTERACTION_MODE

from .bench import COMPLIANT, STIFF, Bench, Fate, K, M
from .moving import amid_a_move
from .rules import NotTestable, assume, expect, inside, offered, rule


def both(bench: Bench) -> None:
    """Check that the joint implements STIFF and COMPLIANT; raises NotTestable."""
    offered(COMPLIANT in bench.interactions, f"{bench.joint} implements STIFF only")


@rule("I1", "STIFF or COMPLIANT per joint")
def per_joint(bench: Bench) -> str:
    both(bench)
    client, before = bench.client, bench.client.get_interaction_mode()
    for interaction in (COMPLIANT, STIFF):
        reply = bench.ask(SET_INTERACTION_MODE, modes=[interaction.code])
        expect(reply, f"{interaction} is available and refused: {reply.message}")
        expected = [*before]
        expected[bench.j] = interaction
        now = client.get_interaction_mode()
        expect(now == expected, f"{interaction} for {bench.joint} alone did not do that")
    return f"{bench.joint} COMPLIANT and STIFF again; the others kept theirs"


@rule("I2", "stored where it does not act")
def stored(bench: Bench) -> str:
    both(bench)
    tried = []
    for mode in (M.IDLE, M.TORQUE, M.OPENLOOP, M.HW_FAULT):
        if mode is M.HW_FAULT:
            bench.fault()
        elif mode in bench.modes:
            bench.enter(mode)
        else:
            continue
        for interaction in (COMPLIANT, STIFF, COMPLIANT):
            reply = bench.client.set_interaction_mode(bench.joint, interaction)
            expect(reply, f"{interaction} is refused in {mode}: {reply.message}")
            stored = bench.client.get_interaction_mode(bench.joint)[0]
            expect(stored is interaction, f"{interaction} was accepted in {mode}, not stored")
        expect(bench.mode is mode, f"{mode} became {bench.mode} with the interaction mode")
        tried.append(mode.name)
    bench.client.set_control_mode(bench.joint, M.FORCE_IDLE)
    bench.enter(M.POSITION)
    stored = bench.client.get_interaction_mode(bench.joint)[0]
    expect(stored is COMPLIANT, "the stored mode is lost on entering POSITION")
    return f"stored in {', '.join(tried)}, there on entering POSITION"


@rule("I3", "alters no accepted commands")
def alters_no_commands(bench: Bench) -> str:
    both(bench)
    kinds = (K.POSITION, K.POSITION_DIRECT, K.VELOCITY)
    fates = []
    for interaction in (STIFF, COMPLIANT):
        bench.home()
        bench.enter(M.POSITION, interaction)
        fates.append([bench.fate(kind, bench.another(kind)) is Fate.ACCEPTED for kind in kinds])
    stiff, compliant = fates
    expect(
        stiff == compliant, f"of {[*map(str, kinds)]} STIFF accepts {stiff}, COMPLIANT {compliant}"
    )
    return f"POSITION accepts the same of {len(kinds)} kinds, STIFF and COMPLIANT"


@rule("I4", "a real change stops the joint")
def change_stops(bench: Bench) -> str:
    both(bench)

    def change(interaction: InteractionMode) -> None:
        reply = bench.client.set_interaction_mode(bench.joint, interaction)
        assume(reply, f"{interaction} is refused, see I1: {reply.message}")

    amid_a_move(bench, lambda: change(STIFF))
    way = bench.run_on(bench.record(0.1))
    expect(way > 0.0, "the present interaction mode again stopped a move")
    *_, now = amid_a_move(bench, lambda: change(COMPLIANT))
    way = bench.run_on([now, *bench.record(0.4)])
    expect(way < bench.tolerance, f"a move ran on for {way:.3g} after the change")
    return "COMPLIANT stopped a move; STIFF in STIFF did not"


@rule("I5", "COMPLIANT is a spring")
def spring(bench: Bench) -> str:
    both(bench)
    way = 0.3 * bench.range.step
    stiffness = soft(bench, way)
    torque = stiffness * way
    # far from each other, so that one in place of the other shows
    damping = min(0.25 * stiffness, float(bench.client.get_max_impedance(bench.joint)[1][0]))
    reply = bench.client.set_impedance(bench.joint, stiffness, damping)
    assume(reply, "impedance is refused, see I6")
    with pushing(bench) as push:  # friction has the same part in both
        half, whole = push(0.5 * torque), push(torque)
    went = float(whole.position[bench.j] - half.position[bench.j])
    expect(
        0.3 * way < went < 0.7 * way,
        f"{0.5 * torque:.3g} more on a spring of {stiffness:.3g} gave {went:.3g}, "
        f"not {0.5 * way:.3g}",
    )
    unit, force = bench.kind.unit, f"{0.5 * torque:.3g} {bench.kind.force_unit}"
    stiff = f"{stiffness:.3g} {bench.kind.force_unit}/{unit}"
    return f"{force} on {stiff}: {went:.3g} {unit} of {0.5 * way:.3g}"


def soft(bench: Bench, way: float, share: float = 0.8) -> float:
    """The stiffness for a deflection of ``way``, rad, by the permitted push; a share at most.

    Raises:
        NotTestable: the joint has no stiffness.
    """
    top = float(bench.client.get_max_impedance(bench.joint)[0][0])
    offered(top > 0.0, "it has no stiffness to set")
    return min(share * top, bench.range.push / way)


@contextmanager
def pushing(bench: Bench) -> Iterator[Callable[[float], State]]:
    """Push a joint in POSITION, COMPLIANT with torques, N·m; each gives the last state of it."""
    bench.enter(M.POSITION, COMPLIANT)
    bench.record(0.5)
    load = float(bench.client.get_torque_offset(bench.joint)[0])

    def push(torque: float) -> State:
        bench.client.set_feedforward(bench.joint, torques=load + torque)
        return bent(bench)

    try:
        yield push
    finally:
        bench.client.set_feedforward(bench.joint, torques=load)


def bent(bench: Bench) -> State:
    """The state after a push, where the joint rests: one that is damped takes seconds."""
    for _ in range(6):
        states = bench.record(1.2)
        places = [float(state.position[bench.j]) for state in states[3 * len(states) // 4 :]]
        if max(places) - min(places) < 3e-3 * bench.range.step:
            break
    return states[-1]


def acts_at_once(bench: Bench) -> None:
    """Half the stiffness doubles the deflection; friction has the same part in both."""
    way = 0.3 * bench.range.step
    stiffness = soft(bench, way, 0.4)  # friction hides what a weaker push does
    assume(bench.client.set_impedance(bench.joint, 2.0 * stiffness), "a stiffness is refused")
    with pushing(bench) as push:
        before, pushed = push(0.0), push(stiffness * way)
        reply = bench.client.set_impedance(bench.joint, stiffness)
        expect(reply, f"a stiffness of {stiffness:.3g} is refused: {reply.message}")
        more = bent(bench)
    first, second = (float(s.position[bench.j] - before.position[bench.j]) for s in (pushed, more))
    assume(first > 0.2 * way, f"a push bent the spring {first:.3g}, not {0.5 * way:.3g}, see I5")
    expect(
        first < 0.75 * second,
        f"half the stiffness set in COMPLIANT did not act: a push bent it {first:.3g} before, "
        f"{second:.3g} after",
    )


@rule("I6", "impedance is set and read at any time")
def impedance(bench: Bench) -> str:
    both(bench)
    client, joint = bench.client, bench.joint
    answer = bench.channel.call(GET_IMPEDANCE, names=[joint])
    top, hardest = answer.max_stiffness[0], answer.max_damping[0]
    tried = []
    for number, mode in enumerate(bench.modes):
        bench.enter(mode)
        impedance = ((0.1 + 0.01 * number) * top, (0.2 + 0.01 * number) * hardest)
        reply = client.set_impedance(joint, *impedance)
        expect(reply, f"refused in {mode}: {reply.message}")
        stored = tuple(float(values[0]) for values in client.get_impedance(joint))
        near = all(
            math.isclose(a, b, rel_tol=1e-6) for a, b in zip(stored, impedance, strict=True)
        )
        expect(near, f"in {mode} {impedance} was set and {stored} is read")
        expect(bench.mode is mode, f"{mode} became {bench.mode} with the impedance")
        tried.append(mode.name)
    for bad in (-1.0, math.nan, math.inf, 1.01 * top + 1.0):
        refused = bench.ask(SET_IMPEDANCE, stiffness=[bad], damping=[0.1 * hardest])
        expect(not refused, f"a stiffness of {bad:g} was accepted; the most is {top:g}")
        kept = float(client.get_impedance(joint)[0][0])
        expect(
            math.isclose(kept, stored[0]), f"a stiffness of {bad:g} was refused, and changed it"
        )
    bench.home()  # without power it may have fallen
    acts_at_once(bench)
    return (
        f"set in {', '.join(tried)}, acts at once; negative, non-finite and above {top:g} refused"
    )


@rule("I7", "without torque sensing only STIFF")
def only_stiff(bench: Bench) -> str:
    if COMPLIANT in bench.interactions:
        raise NotTestable(f"{bench.joint} senses torque; try a joint without: --joint NAME")
    expect(M.TORQUE not in bench.modes, "TORQUE is available without COMPLIANT")
    reply = bench.ask(SET_INTERACTION_MODE, modes=[COMPLIANT.code])
    expect(not reply, "COMPLIANT is not available and was accepted")
    expect(bench.mode is M.HW_FAULT, f"{bench.joint} is in {bench.mode}, not HW_FAULT")
    return f"HW_FAULT, {bench.client.get_faults(bench.joint)[0].text!r}"


inside("I8", "ignored while calibrating", "the law that runs in CALIBRATING is not shown")
inside("I9", "the old impedance modes", "the old interface is the client's")


@rule("I10", "stop in COMPLIANT moves nothing")
def stop_in_compliant(bench: Bench) -> str:
    both(bench)
    bench.enter(M.POSITION, COMPLIANT)
    bench.record(0.3)
    begin = bench.state().stamp
    for _ in range(5):
        reply = bench.client.stop(bench.joint)
        assume(reply, f"stop is refused, see P3: {reply.message}")
        bench.record(0.1)
    way = bench.still(bench.since(begin))
    expect(way < bench.tolerance, f"{bench.joint} at rest moved {way:.3g} with 5 stops")
    return f"5 stops at rest moved it {way:.2g}"
