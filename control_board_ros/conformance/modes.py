# SPDX-License-Identifier: Apache-2.0
"""V and M: vocabs and control modes."""

from __future__ import annotations

from control_board_ros.core.terms.modes import ACCEPTS, STOPPABLE
from control_board_ros.core.terms.reply import Answer
from control_board_ros.core.terms.vocabs import ControlMode, encode
from control_board_ros.interface import GET_CONTROL_MODE, POSITION_COMMAND, SET_CONTROL_MODE

from .bench import TIMEOUT, Bench, Fate, K, M
from .limits import read_limits
from .moving import amid_a_move
from .rules import assume, expect, inside, offered, rule

#: rad; a target this close to the present position causes no motion.
SAME_PLACE_RAD = 1e-3
#: s in which a joint that has a brake is held by it.
CLOSING = 0.1
#: Modes that yield to a load.
UNPOWERED = (M.IDLE, M.OPENLOOP)

STATUSES_AND_EVENTS = ("hwfa", "cal", "cald", "cfgn", "cfgy")


@rule("V1", "codes and vocabs agree")
def codes_and_vocabs(bench: Bench) -> str:
    answer = bench.channel.call(GET_CONTROL_MODE)
    latched = bench.channel.modes[-1]
    pairs = [
        *zip(answer.modes, answer.vocabs, strict=True),
        *zip(latched.control_modes, latched.control_mode_vocabs, strict=True),
        *zip(latched.interaction_modes, latched.interaction_mode_vocabs, strict=True),
    ]
    for code, vocab in pairs:
        expect(vocab == encode(code), f"{code!r} comes with {vocab}, not {encode(code)}")
    return f"{len(pairs)} pairs, as {pairs[0][0]} = {pairs[0][1]}"


inside("V2", "misprints of the source", "it is about the source's text")


@rule("M1", "every joint has its own mode")
def own_modes(bench: Bench) -> str:
    client, before = bench.client, bench.client.get_control_mode()
    target = bench.other
    offered(target, f"{bench.joint} has one active mode only")
    assert target is not None
    reply = bench.ask(SET_CONTROL_MODE, modes=[target.code])
    expect(reply, f"{target} is available and refused: {reply.message}")
    modes = [*before]
    modes[bench.j] = target
    expect(client.get_control_mode() == modes, f"{target} for {bench.joint} alone did not do that")
    expect(
        bench.shows([mode.code for mode in modes]),
        f"{TIMEOUT:g} s after {target} was set for {bench.joint}, ~/modes has "
        f"{' '.join(bench.channel.modes[-1].control_modes)}",
    )
    if bench.partner is None:
        return f"{bench.joint} set alone; there is no other joint"
    pair = [bench.partner, bench.joint]
    reply = client.set_control_mode(pair, M.POSITION)
    expect(reply, f"POSITION for two is refused: {reply.message}")
    modes[bench.j] = modes[bench.names.index(bench.partner)] = M.POSITION
    expect(
        client.get_control_mode() == modes, f"POSITION for {' and '.join(pair)} did not do that"
    )
    expect(client.get_control_mode(pair) == [M.POSITION] * 2, "a subset is read wrongly")
    if set(modes) == {M.POSITION}:
        bench.enter(target)
        reply = client.set_control_mode(None, M.POSITION)
        expect(reply, f"POSITION for all is refused: {reply.message}")
        expect(client.get_control_mode() == modes, "POSITION for all did not do that")
    return f"{bench.joint} alone, then {' and '.join(pair)}, then all; the others kept theirs"


@rule("M2", "modes change on user requests only")
def nobody_switches(bench: Bench) -> str:
    tried = []
    for mode, kind in ((M.POSITION, K.POSITION), (M.VELOCITY, K.VELOCITY), (M.MIXED, K.VELOCITY)):
        if mode not in bench.modes:
            continue
        bench.enter(mode)
        bench.command(kind, bench.another(kind))
        bench.record(0.5)  # the move ends, the velocity expires
        expect(bench.mode is mode, f"{mode} became {bench.mode} while {bench.joint} was used")
        tried.append(mode.name)
    return f"{', '.join(tried)} stayed, with moves that end and velocities that expire"


@rule("M3", "what each mode accepts")
def accepted_commands(bench: Bench) -> str:
    accepted = []
    for mode in bench.modes:
        for kind in sorted(ACCEPTS.get(mode, ())):
            bench.enter(mode)
            fate = bench.fate(kind, bench.another(kind))
            expect(fate is Fate.ACCEPTED, f"{mode} ignored a {kind} reference")
            accepted.append(f"{mode}: {kind}")
    return "; ".join(accepted)


@rule("M4", "other commands are ignored and counted")
def ignored_commands(bench: Bench) -> str:
    count = 0
    for mode in bench.modes:
        if mode is M.IDLE:
            continue
        bench.enter(mode)
        for kind in K:
            if kind not in ACCEPTS.get(mode, ()):
                fate = bench.fate(kind, bench.another(kind))
                expect(fate is not Fate.ACCEPTED, f"{mode} accepted a {kind} reference")
                expect(fate is Fate.COUNTED, f"a {kind} reference in {mode} is not counted")
                count += 1
    never_kept(bench)
    others_are_served(bench)
    return f"{count} pairs of mode and command ignored, counted, and not kept"


def never_kept(bench: Bench) -> None:
    """A move that VELOCITY ignores does not begin in POSITION."""
    if M.VELOCITY not in bench.modes:
        return
    bench.home()  # a mode without position may have let it fall
    bench.enter(M.VELOCITY)
    bench.send(K.POSITION, bench.range.start + bench.range.step)
    bench.state()
    bench.enter(M.POSITION)
    states = bench.record(0.3)
    way = bench.still(states)
    expect(way < bench.tolerance, f"an ignored move began later: {way:.3g} of way")


def others_are_served(bench: Bench) -> None:
    """A joint in POSITION accepts a message that another one ignores."""
    if bench.partner is None or M.VELOCITY not in bench.modes:
        return
    bench.enter(M.VELOCITY)
    mode = bench.client.get_control_mode(bench.partner)[0]
    assume(mode is M.POSITION, f"{bench.partner} is in {mode} then, see M1")
    ignored, before = bench.last(K.POSITION), bench.last(K.POSITION, bench.partner)
    near = beside(bench, bench.partner, before)
    names = [bench.joint, bench.partner]
    bench.channel.send(POSITION_COMMAND, names=names, positions=[bench.another(K.POSITION), near])
    bench.poll(lambda: bench.last(K.POSITION, bench.partner) != before)
    last = bench.last(K.POSITION, bench.partner)
    expect(bench.last(K.POSITION) == ignored, f"VELOCITY accepted a position for {bench.joint}")
    expect(
        abs(last - near) < 1e-5,
        f"{bench.partner} in POSITION was not served beside {bench.joint} in VELOCITY: its target "
        f"is {last:.5g}, not {near:.5g}",
    )


def beside(bench: Bench, joint: str, before: float) -> float:
    """A position at the joint without noticeable motion, different from a reference."""
    there, limits = float(bench.client.get_encoder(joint)[0]), read_limits(bench.client, joint)
    inwards = 1.0 if there < 0.5 * (limits.lower + limits.upper) else -1.0
    near = [there + inwards * part * SAME_PLACE_RAD for part in (1.0, 0.5)]
    return max(near, key=lambda position: abs(position - before))


@rule("M5", "a mode that is not implemented is a user fault")
def not_implemented(bench: Bench) -> str:
    missing = bench.missing
    reply = bench.ask(SET_CONTROL_MODE, modes=[missing.code])
    expect(not reply, f"{missing} is not available and was accepted")
    expect(bench.mode is M.HW_FAULT, f"{bench.joint} is in {bench.mode}, not HW_FAULT")
    expect(reply.answers == (Answer.UNSUPPORTED,), f"the answer is {[*map(str, reply.answers)]}")
    fault = bench.client.get_faults(bench.joint)[0]
    expect(fault.active and fault.text, f"its fault reads {fault.text!r}, active {fault.active}")
    return f"{missing.code}: HW_FAULT, {fault.text!r}"


@rule("M6", "statuses and unknown vocabs are refused")
def statuses_are_refused(bench: Bench) -> str:
    before = bench.client.get_control_mode()
    for mode in (*STATUSES_AND_EVENTS, "nope", ""):
        answer = bench.ask(SET_CONTROL_MODE, modes=[mode])
        expect(not answer, f"{mode!r} was accepted")
        expect(answer.message, f"{mode!r} was refused without a message")
        now = bench.client.get_control_mode()
        expect(now == before, f"{mode!r} was refused and changed modes")
    return f"{', '.join(STATUSES_AND_EVENTS)} and unknown ones refused, nothing changed"


@rule("M8", "the present mode again resets nothing")
def the_same_again(bench: Bench) -> str:
    def again() -> None:
        reply = bench.client.set_control_mode(bench.joint, M.POSITION)
        expect(reply, f"the present mode is refused: {reply.message}")

    amid_a_move(bench, again)
    way = bench.run_on(bench.record(0.1))
    expect(way > 0.0, "the present mode again dropped a move")
    return f"a move went on, {way:.2g} in the next 0.1 s"


@rule("M9", "entering a mode stops the joint and moves nothing")
def entering_resets(bench: Bench) -> str:
    held = [enter_at_rest(bench, mode) for mode in bench.modes if mode not in UNPOWERED]
    if M.POSITION_DIRECT in bench.modes:
        *_, now = amid_a_move(bench, lambda: bench.enter(M.POSITION_DIRECT))
        way = bench.run_on([now, *bench.record(0.4)])
        expect(way < bench.tolerance, f"a move ran on for {way:.3g} after the mode changed")
        held.append("a move dropped")
    if M.OPENLOOP in bench.modes:
        bench.enter(M.OPENLOOP)
        output = float(bench.state().output[bench.j])
        expect(output == 0.0, f"OPENLOOP begins with {output:.3g} %")
        held.append("OPENLOOP at 0 %")
    return f"nothing moved on entering: {', '.join(held)}"


def enter_at_rest(bench: Bench, mode: ControlMode) -> str:
    """Enter a mode, and check that reference and joint stay at the joint's position."""
    limits = bench.range
    bench.home()
    if mode is M.POSITION:
        if bench.other is None:
            return "POSITION"
        bench.enter(bench.other)
    before = bench.state()
    bench.enter(mode)
    states = bench.record(0.3)
    if mode in STOPPABLE:
        gap = float(states[0].position_reference[bench.j] - states[0].position[bench.j])
        expect(
            abs(gap) < 0.01 * (limits.high - limits.low),
            f"on entering {mode} the position reference is {gap:.3g} off the joint",
        )
    way = bench.still([before, *states])
    limit = bench.tolerance * (0.4 if mode in STOPPABLE else 1.0)
    expect(way < limit, f"{bench.joint} moved {way:.3g} on entering {mode}")
    return mode.name


@rule("M10", "IDLE is unpowered")
def idle_is_unpowered(bench: Bench) -> str:
    bench.enter(M.IDLE)
    closed = bench.until(lambda state: bool(state.brake[bench.j]), CLOSING)  # before power goes
    outputs = [float(state.output[bench.j]) for state in bench.record(0.2)]
    waits = any(outputs) and not closed and bench.client.get_brake(bench.joint)[0]
    assume(not waits, "it has power until its brake is closed, see Y4")
    expect(not any(outputs), f"{max(outputs, key=abs):.3g} % in IDLE")
    return f"0 % in {len(outputs)} states"


@rule("M11", "getters keep each kind's last accepted reference")
def last_references(bench: Bench) -> str:
    sent = {}
    for mode in bench.modes:
        for kind in ACCEPTS.get(mode, ()):
            if kind not in sent:
                bench.enter(mode)
                bench.command(kind, bench.another(kind))
                sent[kind] = bench.another(kind)
                fate = bench.fate(kind, sent[kind])  # the second: the first says nothing of order
                assume(fate is not Fate.COUNTED, f"the second {kind} reference is ignored, see M3")
                expect(
                    fate is Fate.ACCEPTED,
                    f"the last {kind} reference is {sent[kind]:.4g}, not {bench.last(kind):.4g}",
                )
    bench.enter(M.POSITION)
    for kind, value in sent.items():
        last = bench.last(kind)
        expect(
            abs(last - value) < 1e-6, f"the last {kind} reference was {value:.4g}, not {last:.4g}"
        )
    return f"{', '.join(map(str, sent))} read back after changes of mode"
