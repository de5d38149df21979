"""Fault settings of a simulated drive: each causes one kind of misbehaviour and can be changed while the drive runs."""

from __future__ import annotations

from dataclasses import dataclass, field

NEVER = float("inf")


@dataclass(slots=True)
class DriveFaults:
    """Misbehaviour of one axis. Every field may be changed at any time; with the defaults the drive behaves correctly.

    Power stage and controlword:
        transition_delay: extra seconds per transition number (``NEVER``: that transition does not occur)
        ignore_halt, ignore_quick_stop, ignore_disable_voltage: the drive ignores that command
        statusword_frozen: 6041h keeps its present value
        no_voltage, local_control: bits 4 and 9 of the statusword are low, and the drive refuses to switch on (4) or ignores
            the controlword (9)
        fault_persists: the cause of a fault persists, a fault reset has no effect
        fault_on_enable: error code of a fault that occurs when the drive is enabled (0: none)

    Modes and set-points:
        modes_refused: modes that 6061h does not follow, although 6502h may claim them
        mode_delay: seconds until 6061h follows 6060h
        ignore_mode_during_halt: a mode that is written to 6060h during halt is ignored; it must be written again afterwards
        acknowledge_delay: seconds from the edge of bit 4 to bit 12 (``NEVER``: no set-point is accepted)
        acknowledge_stays: bit 12 never falls
        acknowledge_never: set-points are accepted, but bit 12 never rises
        acknowledge_duration: seconds after which bit 12 falls although bit 4 is still set (``NEVER``: it waits for bit 4)
        mode_clears_acknowledge: seconds for which a write to 6060h keeps bit 12 low, independent of set-points
        mode_pulses_acknowledge: the same, high
        ignore_setpoint_during_halt: an edge of bit 4 during halt is ignored
        target_reached_late: seconds for which bit 10 stays set after a new set-point was accepted
        target_reached_never: bit 10 does not rise in the profile modes
        target_reached_always: bit 10 is always set
        spontaneous_mode: mode that the drive uses regardless of 6060h (None: it follows 6060h)
        resumes_on_enable: on *enable operation* the drive resumes its last motion: in pp to its last set-point, in pv at its
            last velocity until 60FFh is changed
        halt_in_cyclic_modes: halt works in csp, csv and cst (CiA 402 leaves it open)
        homing_fails: homing ends with bit 13
        homing_reached_never: bit 10 does not rise at the end of homing
        interpolation_delay: seconds from bit 4 in ip until interpolation starts (``NEVER``: it does not)

    Touch probe:
        probe_bits_stay: the edge bits of 60B9h stay set when the touch probe is switched off, and when it is armed again
        probe_deaf: 60B8h is accepted, but arms nothing

    Machine:
        blocked: the rotor is held mechanically
        sticks: breakaway torque of a rotor at standstill, in ‰ of the rated torque (in addition to its friction)
        drift_velocity: increments/s by which the drive moves its motor away from the demand while energised (not in torque modes)
        creep_shown: 6062h shows that motion, too
        demand_frozen: 6062h keeps its present value
        demand_is_actual: 6062h shows the actual position instead of the demand
        demand_is_target: 6062h shows 607Ah instead of the demand
        feedback_delay: seconds by which position, velocity and torque are published late
        encoder_frozen: the position keeps its present value, and the velocity is 0
        encoder_jump: increments added once to the measured position; the drive then sets this field back to 0
    """

    transition_delay: dict[int, float] = field(default_factory=dict)
    ignore_halt: bool = False
    ignore_quick_stop: bool = False
    ignore_disable_voltage: bool = False
    statusword_frozen: bool = False
    no_voltage: bool = False
    local_control: bool = False
    fault_persists: bool = False
    fault_on_enable: int = 0
    modes_refused: frozenset[int] = frozenset()
    mode_delay: float = 0.0
    ignore_mode_during_halt: bool = False
    acknowledge_delay: float = 0.0
    acknowledge_stays: bool = False
    acknowledge_never: bool = False
    acknowledge_duration: float = NEVER
    mode_clears_acknowledge: float = 0.0
    mode_pulses_acknowledge: float = 0.0
    ignore_setpoint_during_halt: bool = False
    target_reached_late: float = 0.0
    target_reached_never: bool = False
    target_reached_always: bool = False
    spontaneous_mode: int | None = None
    resumes_on_enable: bool = False
    halt_in_cyclic_modes: bool = True
    homing_fails: bool = False
    homing_reached_never: bool = False
    interpolation_delay: float = 0.0
    probe_bits_stay: bool = False
    probe_deaf: bool = False
    blocked: bool = False
    sticks: float = 0.0
    drift_velocity: float = 0.0
    creep_shown: bool = False
    demand_frozen: bool = False
    demand_is_actual: bool = False
    demand_is_target: bool = False
    feedback_delay: float = 0.0
    encoder_frozen: bool = False
    encoder_jump: int = 0


@dataclass(slots=True)
class LssFaults:
    """Misbehaviour of one node's LSS slave.

    absent: the node has no LSS (it ignores LSS requests)
    delay: seconds from a request to its answer
    jitter: random additional delay, at most so many seconds
    loss: probability with which each request and each answer is lost
    lost_requests, lost_answers: number of next requests or answers that are lost (they count down)
    store_time: additional seconds until the answer to *store configuration*
    refused_rates: bit rates (bit/s) that the node does not support
    node_id_error, bit_rate_error, store_error: error code of the answer (0: none; 1 to *store* is "not supported")
    specific_error: the manufacturer's error code that accompanies an error code of 255
    answers_on: fast scan is answered in *configuration*, too, against CiA 305
    """

    absent: bool = False
    delay: float = 0.0
    jitter: float = 0.0
    loss: float = 0.0
    lost_requests: int = 0
    lost_answers: int = 0
    store_time: float = 0.0
    refused_rates: frozenset[int] = frozenset()
    node_id_error: int = 0
    bit_rate_error: int = 0
    store_error: int = 0
    specific_error: int = 0
    answers_on: bool = False


@dataclass(slots=True)
class ProgramFaults:
    """Misbehaviour of one node's boot loader.

    control_refused: abort code by the value written to 1F51h (0 stop, 1 start, 2 reset, 3 clear)
    data_refused: abort code with which a whole program is rejected (0: it is accepted)
    clear_time, flash_time: seconds for which 1F57h reports "in progress" after clearing and after the data
    flash_error: error number that 1F57h reports after the data (0: none)
    deaf: the node answers no SDO while it clears or writes its memory
    stop_restarts: stopping the program restarts the node into its boot loader
    restart_delay: seconds from the start command (or such a stop) to the restart of the node
    few_objects: while no program runs, the node has only the objects of its boot loader
    capacity: bytes of its program memory (0: as many as needed)
    checksum: a valid program ends with the CRC-32 of its other bytes, the low byte first
    """

    control_refused: dict[int, int] = field(default_factory=dict)
    data_refused: int = 0
    clear_time: float = 0.0
    flash_time: float = 0.0
    flash_error: int = 0
    deaf: bool = False
    stop_restarts: bool = False
    restart_delay: float = 0.02
    few_objects: bool = False
    capacity: int = 0
    checksum: bool = False


@dataclass(slots=True)
class NodeFaults:
    """Misbehaviour of one node's communication.

    dead: the node neither sends nor receives, as with a cut cable (its motors keep moving until its own watchdog expires)
    unpowered: the node has no supply: it is silent, its motors have no power, and all but stored values is lost. It boots when the
        supply returns
    sdo_delay: seconds from a request to its answer (longer than the client's time-out: an answer that arrives too late)
    sdo_silent: SDO requests are not answered, and not executed
    sdo_lost: numbers of the SDO frames that get lost; both directions are counted together from 1 in ``sdo_frames``
    sdo_frames: number of SDO frames so far; may be reset
    sdo_block: whether the node supports block transfers
    sdo_block_size: segments that it accepts without confirmation, 1 to 127
    sdo_checksum: whether it supports the checksum of a block transfer
    sdo_aborts: abort code by (index, subindex), for reading and writing
    sdo_write_aborts: the same, for writing only
    heartbeat_stops: no more heartbeats; the node otherwise works
    emcy_short: emergency messages have 2 bytes instead of 8
    rpdos_in_order: entries of RPDOs are applied one by one, RPDO by RPDO in the order of their numbers, so that a controlword acts
        on the values present at that moment; otherwise every controlword acts on the values that arrived with it
    fixed_mapping: abort code with which a write to a PDO mapping is rejected (0: it may be changed)
    event_timer_ignored: 18xxh:05 is accepted, but has no effect
    rtr: TPDOs may be requested by remote frames, and accept the transmission types 252 and 253
    tpdos_stop: numbers (from 1) of TPDOs that are no longer sent
    reboot_time: seconds of silence on a reset before boot-up
    reboot_on_store: storing parameters (1010h) restarts the node
    start_error: error code with which the node leaves *operational* as soon as it is started (0: it stays there)
    lss: fault settings of its LSS slave
    program: fault settings of its boot loader, if it has one
    """

    dead: bool = False
    unpowered: bool = False
    sdo_delay: float = 0.0
    sdo_silent: bool = False
    sdo_lost: set[int] = field(default_factory=set)
    sdo_frames: int = 0
    sdo_block: bool = True
    sdo_block_size: int = 127
    sdo_checksum: bool = True
    sdo_aborts: dict[tuple[int, int], int] = field(default_factory=dict)
    sdo_write_aborts: dict[tuple[int, int], int] = field(default_factory=dict)
    heartbeat_stops: bool = False
    emcy_short: bool = False
    rpdos_in_order: bool = False
    fixed_mapping: int = 0
    event_timer_ignored: bool = False
    rtr: bool = False
    tpdos_stop: frozenset[int] = frozenset()
    reboot_time: float = 0.05
    reboot_on_store: bool = False
    start_error: int = 0
    lss: LssFaults = field(default_factory=LssFaults)
    program: ProgramFaults = field(default_factory=ProgramFaults)

    def is_sdo_frame_lost(self) -> bool:
        """Count one SDO frame and return whether it gets lost."""
        self.sdo_frames += 1
        return self.sdo_frames in self.sdo_lost

    def refusal(self, index: int, subindex: int, *, writing: bool) -> int | None:
        """Return the abort code with which an SDO request is rejected, or None if it is accepted."""
        code = self.sdo_aborts.get((index, subindex))
        if code is None and writing:
            code = self.sdo_write_aborts.get((index, subindex))
        return code
