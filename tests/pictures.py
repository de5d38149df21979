"""Draws the pictures of docs/motion.md from simulated drives, in virtual time. ``make pictures``."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

from axisbus import AxisFeedback, Cam, Machine, Recorder, Scara, TrapezoidalTrajectory, eds, wait
from axisbus.eds import builtin
from axisbus.errors import AxisbusError
from axisbus.machine.groups import Group
from axisbus.sim.build import device_from_eds, motor_from_eds
from kit.cell import GENERIC, Stage
from kit.sim.interpolated import write_eds

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "docs" / "pictures"
SQUARE = [(60.0, 0.0), (60.0, 40.0), (0.0, 40.0), (0.0, 0.0)]
COLOURS = ("#1f5fa8", "#c2571a", "#3b8a3e")
OVER = 5  # cycles from which a speed is calculated


class Trace(NamedTuple):
    """The positions of two axes, cycle by cycle: seconds from the beginning, and positions in their units."""

    times: list[float]
    x: list[float]
    y: list[float]

    @property
    def speeds(self) -> list[float]:
        """Along the path, per s."""
        rows = list(zip(*self, strict=True))
        found = [math.dist(a[1:], b[1:]) / (b[0] - a[0]) for a, b in zip(rows, rows[OVER:], strict=False)]
        return [0.0] * (len(rows) - len(found)) + found


def traced(what: Callable[[Machine, Group], None], column: str = "position") -> Trace:
    """Return the positions of two simulated axes, or their demand (``demand``)."""
    with Machine.simulated(ROOT / "examples" / "cell.toml") as cell:
        group = cell.group("x", "y")
        group.enable().wait()
        wait(axis.home() for axis in group)
        with Recorder(cell) as recorder:
            what(cell, group)
            cell.sleep(0.1)
        tracks = recorder.recorded().tracks
    times = tracks["x"].times
    places = [list(tracks[name].columns[column]) for name in "xy"]
    return Trace([time - times[0] for time in times], *places)


def two_views(traces: dict[str, Trace]) -> tuple[Any, Any]:
    """Draw the path and the speed of the axes; return the figure and the speed diagram."""
    figure, (path, speed) = plt.subplots(1, 2, figsize=(10, 3.8), width_ratios=(1, 1.3), layout="constrained")
    for (name, trace), colour in zip(traces.items(), COLOURS, strict=False):
        path.plot(trace.x, trace.y, color=colour, linewidth=1.3, label=name)
        speed.plot(trace.times, trace.speeds, color=colour, linewidth=1.3, label=name)
    path.set(xlabel="x in deg", ylabel="y in deg", aspect="equal", title="path of the axes")
    speed.set(xlabel="s", ylabel="deg/s", title="speed along the path")
    speed.set_ylim(bottom=0.0)
    return figure, speed


def save(figure: Any, file: str) -> None:
    """Write a picture, with the grid and the title of all pictures."""
    for axes in figure.axes:
        axes.grid(alpha=0.3)
    figure.suptitle("simulated drives", fontsize=9, color="#666666", x=0.99, ha="right")
    figure.savefig(FOLDER / file, dpi=110)


def corners() -> None:
    """The same square with three roundings."""
    traces = {
        f"blend = {blend:g} deg": traced(
            lambda _, xy, b=blend: xy.move_path(SQUARE, velocity=120.0, blend=b).wait()
        )
        for blend in (0.0, 2.0, 8.0)
    }
    figure, _ = two_views(traces)
    figure.axes[0].legend(loc="center", fontsize=8)
    save(figure, "path.png")


def override() -> None:
    """One path: slowed down, held, sped up, halted and resumed."""
    marks: list[tuple[float, str]] = []

    def run(cell: Machine, xy: Group) -> None:
        begun = cell.session.snapshots["x"].now
        handle = xy.move_path(SQUARE, velocity=80.0, blend=3.0)

        def mark(text: str, pause: float) -> None:
            marks.append((cell.session.snapshots["x"].now - begun, text))
            cell.sleep(pause)

        cell.sleep(0.5)
        for factor, pause in ((0.3, 0.8), (1.5, 0.5), (0.0, 0.5), (1.0, 0.4)):
            xy.set_override(factor)
            mark(f"{factor:g}", pause)
        xy.halt()
        mark("halt", 0.6)
        handle = xy.resume()
        mark("resume", 0.0)
        handle.wait()

    figure, speed = two_views({"path": traced(run)})
    top = speed.get_ylim()[1]
    for time, text in marks:
        speed.axvline(time, color="#999999", linewidth=0.8, linestyle=":")
        speed.text(time + 0.03, top * 0.97, text, fontsize=8, color="#444444", va="top")
    speed.set_title("speed along the path, and the override")
    save(figure, "override.png")


def override_axis() -> None:
    """A move that a drive plans, and a trajectory, under the overrides of their cell."""
    marks: list[tuple[float, str]] = []

    def run(cell: Machine, _: Group) -> None:
        begun = cell.session.snapshots["x"].now
        handles = [
            cell["x"].move_absolute(150.0, velocity=80.0, acceleration=400.0),
            cell["y"].follow(TrapezoidalTrajectory(cell["y"].commanded_position, 80.0, 50.0, 250.0)),
        ]
        cell.sleep(0.6)
        for factor, pause in ((0.4, 0.7), (0.0, 0.8), (1.5, 0.6), (1.0, 0.0)):
            cell.set_override(factor).wait()
            marks.append((cell.session.snapshots["x"].now - begun, f"{factor:g}"))
            cell.sleep(pause)
        wait(handles)

    trace = traced(run)
    figure, (place, speed) = plt.subplots(1, 2, figsize=(10, 3.4), layout="constrained")
    for name, values, colour in zip(
        ("x: a move that the drive plans (pp)", "y: a trajectory (csp)"),
        (trace.x, trace.y),
        COLOURS,
        strict=False,
    ):
        step = trace.times[1] - trace.times[0]
        speeds = [(b - a) / step / OVER for a, b in zip(values, values[OVER:], strict=False)]
        place.plot(trace.times, values, color=colour, linewidth=1.3, label=name)
        speed.plot(trace.times[OVER:], speeds, color=colour, linewidth=1.3, label=name)
    top = speed.get_ylim()[1]
    for time, text in marks:
        speed.axvline(time, color="#999999", linewidth=0.8, linestyle=":")
        speed.text(time + 0.02, top * 0.97, text, fontsize=8, color="#444444", va="top")
    place.set(xlabel="s", ylabel="deg", title="positions")
    speed.set(xlabel="s", ylabel="deg/s", title="velocities, and the override of the cell")
    place.legend(fontsize=8)
    save(figure, "override-axis.png")


def superimposed() -> None:
    """A distance added to a line, and one added to an axis that is nearly at max_velocity."""

    def over_line(cell: Machine, xy: Group) -> None:
        line = xy.move_linear((60.0, 30.0), velocity=60.0, acceleration=300.0)
        cell.sleep(0.3)
        cell["y"].move_superimposed(8.0, velocity=25.0, acceleration=200.0).wait()
        line.wait()

    def near_limit(cell: Machine, _: Group, distance: float = 0.0) -> None:
        cell["x"].move_absolute(-160.0).wait()
        below = cell["x"].follow(TrapezoidalTrajectory(cell["x"].commanded_position, 110.0, 324.0, 2000.0))
        cell.sleep(0.3)
        cell["x"].move_superimposed(distance, velocity=200.0, acceleration=1000.0)
        below.wait()

    figure, (path, speed) = plt.subplots(1, 2, figsize=(10, 3.4), layout="constrained")
    trace = traced(over_line)
    path.plot(trace.x, trace.y, color=COLOURS[0], linewidth=1.3, label="path of the axes")
    path.plot([0.0, 60.0], [0.0, 30.0], color="#999999", linewidth=1.0, linestyle=":", label="the line alone")
    for name, distance, colour in (("sum", 50.0, COLOURS[0]), ("underlying motion", 0.0, COLOURS[1])):
        trace = traced(partial(near_limit, distance=distance))
        step = OVER * (trace.times[1] - trace.times[0])
        rates = [(b - a) / step for a, b in zip(trace.x, trace.x[OVER:], strict=False)]
        begin = next(
            n
            for n, (rate, place) in enumerate(zip(rates, trace.x, strict=False))
            if place < -155.0 and rate > 1.0
        )
        times = [time - trace.times[begin] for time in trace.times[begin + OVER :]]
        speed.plot(times, rates[begin:], color=colour, linewidth=1.3, label=name)
    speed.axhline(360.0, color="#999999", linewidth=0.8, linestyle=":")
    path.set(xlabel="x in deg", ylabel="y in deg", title="8 deg added to y")
    speed.set(xlabel="s", ylabel="deg/s", title="50 deg added to x: limited to max_velocity")
    path.legend(fontsize=8)
    speed.legend(fontsize=8)
    save(figure, "superimposed.png")


def blending() -> None:
    """Two moves of one axis in the four modes, controlled by the master and by the drive, and corners of a group's lines."""

    def moves(cell: Machine, _: Group, speeds: tuple[float, float], mode: str, led: bool) -> None:
        x, buffer = cell["x"], f"blending_{mode}"
        x.move_absolute(60.0, velocity=speeds[0], acceleration=400.0, buffer=buffer if led else False)
        x.move_absolute(150.0, velocity=speeds[1], acceleration=400.0, buffer=buffer).wait()

    def square(_: Machine, xy: Group, blend: float) -> None:
        lines = [xy.move_linear(SQUARE[0], velocity=90.0)]
        lines += [xy.move_linear(to, velocity=90.0, buffer="blending_low", blend=blend) for to in SQUARE[1:]]
        wait(lines)

    figure, (faster, slower, path) = plt.subplots(1, 3, figsize=(11, 3.6), layout="constrained")
    for view, speeds, modes in (
        (faster, (60.0, 120.0), {"low": "low, previous", "high": "next, high"}),
        (slower, (120.0, 60.0), {"low": "low, next", "high": "previous, high"}),
    ):
        for (mode, name), colour in zip(modes.items(), COLOURS, strict=False):
            for led, style in ((True, "-"), (False, ":")):
                trace = traced(partial(moves, speeds=speeds, mode=mode, led=led))
                begin = next(n for n, place in enumerate(trace.x) if place > 0.2)
                times = [time - trace.times[begin] for time in trace.times[begin:]]
                rates = trace.speeds[begin:]
                label = name if led else f"{name}: the drive plans"
                view.plot(times, rates, style, color=colour, linewidth=1.3, label=label)
                joint = next(n for n, place in enumerate(trace.x[begin:]) if place >= 60.0)
                view.plot(times[joint], rates[joint], "o", color=colour, markersize=4)
        title = "to 60 deg (dots) with {:g} deg/s, then with {:g}".format(*speeds)
        view.set(xlabel="s", ylabel="deg/s", title=title, ylim=(0.0, 200.0))
        view.title.set_fontsize(9)
        view.legend(fontsize=7, loc="upper left" if view is faster else "upper right")
    for blend, colour in zip((1.0, 3.0, 6.0), COLOURS, strict=True):
        trace = traced(partial(square, blend=blend))
        path.plot(trace.x, trace.y, color=colour, linewidth=1.3, label=f"blend = {blend:g}")
    path.set(xlabel="x in deg", ylabel="y in deg", aspect="equal")
    path.set_title("lines of a group", fontsize=9)
    path.legend(fontsize=7, loc="center")
    save(figure, "blending.png")


def feed_forward() -> None:
    """The lag of a motor in the same move, without and with feed-forward: a motor that lags, and one with a load on a spring."""
    lagging = {"lag": 0.02}
    sprung = {"stiffness": 4.0, "damping": 0.5, "rated_acceleration": 2.0e5, "friction": 0.0}
    figure, panels = plt.subplots(1, 2, figsize=(10, 3.4), layout="constrained")
    told = (
        ("a motor that lags by 20 ms", lagging, "velocity = true\n", "velocity feed-forward (60B1h)"),
        ("a load on a spring", sprung, "inertia = 0.005\n", "torque feed-forward (60B2h)"),
    )
    for panel, (title, motor, keys, what) in zip(panels, told, strict=True):
        for name, more, colour in (("without", "", COLOURS[1]), (f"with {what}", keys, COLOURS[0])):
            times, behind = _behind(motor, more)
            panel.plot(times, behind, color=colour, linewidth=1.3, label=name)
        panel.set(xlabel="s", ylabel="lag in deg", title=title)
        panel.legend(fontsize=8)
    save(figure, "feed-forward.png")


def _behind(motor: dict[str, float], keys: str) -> tuple[list[float], list[float]]:
    """Return the lag of the motor behind its demand in a move of 60 deg, step by step."""
    axis = "rated_torque = 10.0\nposition_limits = [-90.0, 90.0]\n"
    more = f"[axes.x.feed_forward]\n{keys}" if keys else ""
    with tempfile.TemporaryDirectory() as folder, Stage(Path(folder)) as stage:
        model = eds.load(builtin.resolve(GENERIC, Path(folder)))
        plant = replace(motor_from_eds(model), **motor)  # type: ignore[arg-type]
        cell = stage.simulated(
            "x", axis=axis, more=more, devices=lambda: {1: device_from_eds(model, 1, plant)}
        )
        cell.enabled()
        moment = cell.moment()
        cell.x.follow(TrapezoidalTrajectory(0.0, 60.0, 100.0, 300.0)).wait(10)
        samples = cell.record().since(moment)
    begin = next(sample.time for sample in samples if sample.demand)
    shown = [sample for sample in samples if begin - 0.05 < sample.time < begin + 1.1]
    return [sample.time - begin for sample in shown], [sample.demand - sample.position for sample in shown]


def jerk() -> None:
    """One line without and with a jerk limit."""
    figure, (speed, rate) = plt.subplots(1, 2, figsize=(10, 3.4), layout="constrained")
    for (name, limit), colour in zip(
        (("without jerk limit", None), ("jerk = 8000 deg/s³", 8000.0)), COLOURS, strict=False
    ):

        def run(_: Machine, xy: Group, limit: float | None = limit) -> None:
            xy.move_linear((60.0, 30.0), velocity=120.0, acceleration=600.0, jerk=limit).wait()

        trace = traced(run)
        step = trace.times[1] - trace.times[0]
        speeds = trace.speeds
        rates = [(b - a) / step / OVER for a, b in zip(speeds, speeds[OVER:], strict=False)]
        speed.plot(trace.times, speeds, color=colour, linewidth=1.3, label=name)
        rate.plot(trace.times[OVER:], rates, color=colour, linewidth=1.3, label=name)
    speed.set(xlabel="s", ylabel="deg/s", title="speed along the line")
    rate.set(xlabel="s", ylabel="deg/s²", title="acceleration along the line")
    speed.legend(fontsize=8)
    save(figure, "jerk.png")


def jerk_path() -> None:
    """The same corners without and with a jerk limit, from differences of the commanded positions."""
    figure, rows = plt.subplots(1, 3, figsize=(12, 3.4), layout="constrained")
    corners = [(60.0, 0.0), (60.0, 40.0), (0.0, 40.0)]
    for (name, limit), colour in zip(
        (("without jerk limit", None), ("jerk = 8000 deg/s³", 8000.0)), COLOURS, strict=False
    ):

        def run(_: Machine, xy: Group, limit: float | None = limit) -> None:
            xy.move_path(corners, velocity=120.0, acceleration=600.0, blend=5.0, jerk=limit).wait()

        trace = traced(run, "demand")
        step = OVER * (trace.times[1] - trace.times[0])
        values = list(zip(trace.x, trace.y, strict=True))
        for order, panel in enumerate(rows, 1):
            values = [
                tuple((b - a) / step for a, b in zip(p, q, strict=True))
                for p, q in zip(values, values[OVER:], strict=False)
            ]
            sizes = [math.hypot(*value) for value in values]
            panel.plot(trace.times[order * OVER :], sizes, color=colour, linewidth=1.2, label=name)
    rows[0].set(xlabel="s", ylabel="deg/s", title="speed")
    rows[1].set(xlabel="s", ylabel="deg/s²", title="acceleration, in any direction")
    rows[2].set(xlabel="s", ylabel="deg/s³", title="jerk, from positions in whole increments")
    rows[2].axhline(8000.0, color="#666666", linewidth=0.8, linestyle="--")
    rows[2].set_ylim(0.0, 24000.0)
    rows[0].legend(fontsize=8)
    save(figure, "jerk-path.png")


def coupled(what: Callable[[Machine], None]) -> tuple[Trace, tuple[float, ...], list[float], list[float]]:
    """Return the motion of two coupled axes: their trace, and their speeds."""
    trace = traced(lambda cell, _: what(cell))
    step = OVER * (trace.times[1] - trace.times[0])
    both = [
        [0.0] * OVER + [(b - a) / step for a, b in zip(places, places[OVER:], strict=False)]
        for places in (trace.x, trace.y)
    ]
    return trace, tuple(trace.times), *both


def controller() -> None:
    """A loop whose target position jumps, and one that raises an exception during the motion."""

    def measured(fails: float) -> Any:
        begin: list[float] = []

        def loop(seen: AxisFeedback) -> float:
            begin.append(seen.time)
            t = seen.time - begin[0]
            if t > fails:
                raise ValueError("lost sight of it")
            return 6.0 * ((40.0 if t % 2.0 < 1.0 else 10.0) - seen.position)

        def follow(cell: Machine, _: Group) -> None:
            cell["x"].controller(loop)
            cell.sleep(3.0)

        trace = traced(follow)
        return trace.times, trace.x, trace.speeds

    figure, (place, speed) = plt.subplots(1, 2, figsize=(10, 3.4), layout="constrained")
    for fails, name, colour in ((9.0, "answers", COLOURS[0]), (1.3, "exception at 1.3 s", COLOURS[1])):
        times, places, speeds = measured(fails)
        place.plot(times, places, color=colour, linewidth=1.3, label=name)
        speed.plot(times, speeds, color=colour, linewidth=1.3, label=name)
    place.set(xlabel="s", ylabel="deg", title="position; its target alternates: 40 deg, 10 deg")
    speed.set(xlabel="s", ylabel="deg/s", title="speed, with the ramps of the axis")
    place.legend(fontsize=8)
    save(figure, "controller.png")


def jerk_axis() -> None:
    """One move without and with a jerk limit, by a drive that limits its jerk and by the master."""
    figure, (speed, rate) = plt.subplots(1, 2, figsize=(10, 3.4), layout="constrained")
    ways = (
        ("without jerk limit", "builtin:generic-cia402", math.inf, "-"),
        ("by the drive (60A4h)", "builtin:generic-cia402", 5000.0, "-"),
        ("by the master (csp)", "builtin:gim6010-8", 5000.0, "--"),
    )
    for (name, file, limit, line), colour in zip(ways, COLOURS, strict=True):
        times, places = _moved(
            file, lambda cell, limit=limit: cell["x"].move_absolute(60.0, jerk=limit).wait()
        )
        step = times[1] - times[0]
        speeds = [(b - a) / step / OVER for a, b in zip(places, places[OVER:], strict=False)]
        rates = [(b - a) / step / OVER for a, b in zip(speeds, speeds[OVER:], strict=False)]
        speed.plot(times[OVER:], speeds, line, color=colour, linewidth=1.3, label=name)
        rate.plot(times[2 * OVER :], rates, line, color=colour, linewidth=1.3, label=name)
    speed.set(xlabel="s", ylabel="deg/s", title="commanded velocity")
    rate.set(xlabel="s", ylabel="deg/s²", title="commanded acceleration; jerk = 5000 deg/s³")
    speed.legend(fontsize=8)
    save(figure, "jerk-axis.png")


def jerk_velocity() -> None:
    """Several velocities, a move and a halt, without and with a jerk limit."""
    figure, (speed, rate) = plt.subplots(2, 1, figsize=(10, 5.2), sharex=True, layout="constrained")
    ways = (("without jerk limit, by the drive", math.inf), ("by the master, jerk = 4000 deg/s³", 4000.0))

    def turn(cell: Machine, limit: float) -> None:
        x = cell["x"]
        for velocity, seconds in ((120.0, 0.6), (40.0, 0.15), (-100.0, 0.7)):
            x.move_velocity(velocity, jerk=limit)
            cell.sleep(seconds)
        x.move_absolute(30.0, velocity=120.0, jerk=limit)
        cell.sleep(1.4)
        x.move_velocity(100.0, jerk=limit)
        cell.sleep(0.5)
        x.halt().wait()
        cell.sleep(0.1)

    for (name, limit), colour in zip(ways, COLOURS, strict=False):
        times, places = _moved("builtin:gim6010-8", partial(turn, limit=limit))
        step = times[1] - times[0]
        speeds = [(b - a) / step / OVER for a, b in zip(places, places[OVER:], strict=False)]
        rates = [(b - a) / step / OVER for a, b in zip(speeds, speeds[OVER:], strict=False)]
        speed.plot(times[OVER:], speeds, color=colour, linewidth=1.3, label=name)
        rate.plot(times[2 * OVER :], rates, color=colour, linewidth=1.3, label=name)
    speed.set(ylabel="deg/s", title="120, 40, then -100 deg/s; a move to 30 deg; 100 deg/s, and a halt")
    rate.set(xlabel="s", ylabel="deg/s²", title="acceleration")
    speed.legend(fontsize=8)
    save(figure, "jerk-velocity.png")


def _moved(file: str, what: Callable[[Machine], object]) -> tuple[list[float], list[float]]:
    """Return the demand of the drive (6062h) during ``what``."""
    text = (
        f'[bus]\ninterface = "sim"\nscan_period = "4ms"\n[nodes.1]\neds = "{file}"\n[axes.x]\nnode = 1\nunit = "deg"\n'
        "scale = 364.0\nmax_velocity = 400.0\n[axes.x.defaults]\nvelocity = 100.0\nacceleration = 500.0\n"
        '[axes.x.stop]\nhalt = "slow-ramp"\n'
    )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "cell.toml"
        path.write_text(text, encoding="utf-8")
        with Machine.simulated(path) as cell:
            cell["x"].enable().wait()
            with Recorder(cell) as recorder:
                what(cell)
            track = recorder.recorded().tracks["x"]
    places = list(track.columns["demand"])
    first = next(number for number, place in enumerate(places) if abs(place) > 0.01)
    times = [time - track.times[first] for time in track.times]
    return times[max(0, first - 10) :], places[max(0, first - 10) :]


def gear() -> None:
    """A gear without ``sync_positions``, and one with them."""

    def at_speed(cell: Machine) -> None:
        cell["x"].move_velocity(60.0, acceleration=200.0)
        cell.sleep(0.5)
        cell["y"].gear_in(cell["x"], 0.5, acceleration=120.0)
        cell.sleep(0.7)
        cell["x"].halt()
        cell.sleep(0.5)

    def at_place(cell: Machine) -> None:
        meeting = cell["y"].gear_in(cell["x"], -0.5, sync_positions=(60.0, 10.0), master_start_distance=40.0)
        cell["x"].follow([(0.0, 0.0), (0.5, 20.0), (1.0, 50.0), (1.7, 90.0)]).wait()
        meeting.wait()

    figure, (speed, place) = plt.subplots(1, 2, figsize=(10, 3.4), layout="constrained")
    _, times, *speeds = coupled(at_speed)
    for name, values, colour in zip("xy", speeds, COLOURS, strict=False):
        speed.plot(times, values, color=colour, linewidth=1.3, label=name)
    trace, *_ = coupled(at_place)
    place.plot(trace.x, trace.y, color=COLOURS[1], linewidth=1.3)
    place.plot([60.0], [10.0], "o", color="#444444", markersize=4)
    place.axvspan(20.0, 60.0, color="#dddddd", alpha=0.5)
    place.text(21.0, -4.6, "master_start_distance = 40 deg", fontsize=8, color="#444444")
    place.annotate("sync_positions\n= (60, 10)", (60.0, 10.0), (63.0, 10.4), fontsize=8, color="#444444")
    speed.set(xlabel="s", ylabel="deg/s", title="gear_in(x, 0.5): y reaches half the speed of x")
    place.set(xlabel="x in deg", ylabel="y in deg", title="gear_in(x, -0.5, sync_positions=(60, 10), ...)")
    speed.legend(fontsize=8)
    save(figure, "gear.png")


def phase() -> None:
    """A phase shift of a slave axis, forward and back, while both axes move."""

    def run(cell: Machine) -> None:
        x, y = cell["x"], cell["y"]
        wait([x.move_absolute(-170.0), y.move_absolute(-85.0)])
        x.move_velocity(60.0, acceleration=300.0).wait()
        y.gear_in(x, 0.5).wait()
        cell.sleep(0.4)
        y.phasing_relative(20.0, velocity=40.0, acceleration=150.0).wait()
        cell.sleep(0.4)
        y.phasing_relative(-20.0, velocity=80.0, acceleration=300.0).wait()
        cell.sleep(0.2)

    trace, times, *speeds = coupled(run)
    begin = next(number for number, speed in enumerate(speeds[0]) if speed > 1.0)
    figure, (speed, ahead) = plt.subplots(1, 2, figsize=(10, 3.4), layout="constrained")
    shown = [time - times[begin] for time in times[begin:]]
    for name, values, colour in zip("xy", speeds, COLOURS, strict=False):
        speed.plot(shown, values[begin:], color=colour, linewidth=1.3, label=name)
    step = (
        next(n for n in range(begin, len(speeds[1])) if speeds[1][n] > 29.9) + OVER
    )  # from there on y is in step
    off = [2.0 * y - x for x, y in zip(trace.x[step:], trace.y[step:], strict=True)]
    ahead.plot(shown[step - begin :], [one - off[0] for one in off], color=COLOURS[2], linewidth=1.3)
    ahead.sharex(speed)
    speed.set(xlabel="s", ylabel="deg/s", title="y.gear_in(x, 0.5), and phasing_relative twice")
    ahead.set(xlabel="s", ylabel="deg of x", title="phase shift, from the positions of x and y")
    speed.legend(fontsize=8)
    save(figure, "phase.png")


def interpolated() -> None:
    """A trajectory on a drive without csp, then a move that the drive plans: the values sent and the values received."""
    rows: list[tuple[float, ...]] = []
    with tempfile.TemporaryDirectory() as folder, Stage(Path(folder)) as stage:
        cell = stage.simulated("x", eds=write_eds(stage.folder), axis="max_acceleration = 2000.0")
        cell.x.enable().wait(5)
        drive, begun = cell.drive("x"), cell.now
        cell.each_cycle(
            lambda now, _: rows.append(
                (
                    now - begun,
                    drive.interpolation_target / cell.scale_of("x"),
                    cell.where("x"),
                    float(drive.mode_display),
                    float(bool(drive.controlword & 1 << 4)),
                    float(bool(drive.statusword & 1 << 12)),
                )
            )
        )
        cell.run(0.1)
        cell.end_of(cell.x.follow(TrapezoidalTrajectory(0.0, 40.0, 60.0, 300.0)))
        cell.run(0.2)
        cell.end_of(cell.x.move_absolute(10.0))
    times, target, where, mode, sent, told = zip(*rows, strict=True)
    figure, (place, bits) = plt.subplots(
        2, 1, figsize=(8, 4.6), sharex=True, height_ratios=(1.4, 1), layout="constrained"
    )
    place.plot(times, where, color=COLOURS[0], linewidth=1.3, label="actual position")
    led = [number for number, value in enumerate(mode) if value == 7]
    points = [times[number] for number in led], [target[number] for number in led]
    place.plot(*points, "--", color=COLOURS[1], linewidth=1.0, label="60C1h:01, the set-point of each cycle")
    place.set(ylabel="deg", title="follow(...) of a drive without csp, then move_absolute(10)")
    for number, (values, name) in enumerate(((told, "bit 12 of 6041h"), (sent, "bit 4 of 6040h"))):
        bits.step(
            times,
            [1.5 * number + value for value in values],
            where="post",
            color=COLOURS[number],
            linewidth=1.2,
        )
        bits.text(0.01, 1.5 * number + 1.08, name, fontsize=8, color=COLOURS[number])
    modes = [number for number, value in enumerate(mode) if not number or value != mode[number - 1]]
    for number in modes:
        bits.annotate(f"mode {mode[number]:g}", (times[number], 3.0), fontsize=8, color="#444444")
        bits.axvline(times[number], color="#888888", linewidth=0.8, linestyle=":")
    bits.set(xlabel="s", ylim=(-0.2, 3.5), yticks=[])
    place.legend(fontsize=8)
    save(figure, "interpolated.png")


def cam() -> None:
    """A cam that the slave axis joins from another position."""
    lobes = Cam([(0.0, 0.0), (90.0, 20.0), (180.0, 0.0), (270.0, 20.0), (360.0, 0.0)], periodic=True)

    def run(cell: Machine) -> None:
        cell["y"].move_absolute(8.0).wait()
        cell["y"].cam_in(cell["x"], lobes, master_start_distance=60.0)
        cell["x"].follow([(0.0, 0.0), (2.0, 90.0), (3.0, 150.0), (3.5, 175.0)]).wait()

    trace, *_ = coupled(run)
    figure, place = plt.subplots(figsize=(7, 3.4), layout="constrained")
    masters = [n * 2.0 for n in range(91)]
    place.plot(
        masters,
        [lobes.at(m) for m in masters],
        color="#999999",
        linewidth=1.0,
        linestyle="--",
        label="the cam",
    )
    place.plot(trace.x, trace.y, color=COLOURS[1], linewidth=1.3, label="y")
    place.axvspan(0.0, 60.0, color="#dddddd", alpha=0.5)
    place.text(1.0, 18.5, "master_start_distance = 60 deg", fontsize=8, color="#444444")
    place.set(xlabel="x in deg", ylabel="y in deg", title="position of y over the position of x")
    place.legend(fontsize=8)
    save(figure, "cam.png")


def stream() -> None:
    """Points that a program pushes at its own pace; some come too late."""

    def run(cell: Machine, xy: Group) -> None:
        def give(last: int) -> None:
            while points.count < last:
                t = 0.02 * points.count
                grown = 20.0 * min(t, 1.0) ** 2 * (3.0 - 2.0 * min(t, 1.0))
                points.push((grown * math.sin(3.0 * t) + 20.0, grown * math.sin(6.0 * t)))

        xy.move_linear((20.0, 0.0), velocity=60.0).wait()
        with xy.stream(period="20ms") as points:
            give(110)
            cell.sleep(1.2)
            give(190)

    trace = traced(run)
    first = next(n for n, x in enumerate(trace.x) if x > 19.99)
    trace = Trace(*(row[first:] for row in trace))
    figure, speed = two_views({"a stream": trace})
    speed.set(title="speed along the path: the points come late once")
    save(figure, "stream.png")


def workspace() -> None:
    """A straight line of the tool of an arm, and the path of the tool if the joints move on a straight line."""
    machine = Scara(200.0, 150.0)
    start, goal = (0.0, 40.0), machine.inverse((-30.0, 327.0))

    def traced_from(run: Callable[[Group], None]) -> Trace:
        spent: list[float] = []

        def both(cell: Machine, xy: Group) -> None:
            begun = cell.session.snapshots["x"].now
            xy.move_direct(start).wait()
            spent.append(cell.session.snapshots["x"].now - begun)
            run(xy)

        rows = [row for row in zip(*traced(both), strict=True) if row[0] >= spent[0]]
        return Trace(*(list(column) for column in zip(*rows, strict=True)))

    arm = traced_from(
        lambda xy: (
            xy.with_kinematics(machine)
            .move_linear((-30.0, 327.0), velocity=250.0, acceleration=1500.0)
            .wait()
        )
    )
    joints = traced_from(lambda xy: xy.move_linear(goal, velocity=100.0).wait())
    figure, (place, speed) = plt.subplots(1, 2, figsize=(10, 3.6), layout="constrained")
    for name, trace, colour in (
        ("line of the tool", arm, COLOURS[0]),
        ("line of the joints", joints, COLOURS[1]),
    ):
        tool = [machine.forward(pair) for pair in zip(trace.x, trace.y, strict=True)]
        place.plot([x for x, _ in tool], [y for _, y in tool], color=colour, linewidth=1.3, label=name)
    step = OVER * (arm.times[1] - arm.times[0])
    for name, values, colour in (("shoulder", arm.x, COLOURS[0]), ("elbow", arm.y, COLOURS[2])):
        rates = [(b - a) / step for a, b in zip(values, values[OVER:], strict=False)]
        speed.plot(
            [t - arm.times[0] for t in arm.times[OVER:]], rates, color=colour, linewidth=1.3, label=name
        )
    place.set(xlabel="x in mm", ylabel="y in mm", aspect="equal", title="path of the tool")
    speed.set(xlabel="s", ylabel="deg/s", title="joint velocities on the line of the tool")
    place.legend(fontsize=8)
    speed.legend(fontsize=8)
    save(figure, "workspace.png")


def beam(what: Callable[[Machine], None], x: float, y: float) -> tuple[list[float], list[float], list[float]]:
    """Return the times and the positions of both motors of examples/gantry.toml, with switches at x and y (mm of the motors)."""
    seen: tuple[list[float], list[float], list[float]] = ([], [], [])
    with Machine.simulated(ROOT / "examples" / "gantry.toml") as cell:
        drives = [cell.simulated_node(node).drive() for node in (1, 2)]
        for drive, at in zip(drives, (x, y), strict=True):
            drive.touch_probe.put_mark(1, at * 1000.0 - 500_000.0, at * 1000.0)
        cell.gantry("y").enable().wait()
        begun = cell.session.snapshots["y1"].now

        def look(now: float, _: object) -> None:
            for column, value in zip(
                seen, (now - begun, *(d.axis.motor.position / 1000.0 for d in drives)), strict=True
            ):
                column.append(value)

        cell.session.observe(look)
        what(cell)
        cell.session.forget(look)
    return seen


def gantry() -> None:
    """A pair homed by two switches, and one side that jams."""
    switches = (-20.0, -22.0)

    def home(cell: Machine) -> None:
        cell.gantry("y").home().wait()
        cell.sleep(0.2)

    def jam(cell: Machine) -> None:
        y = cell.gantry("y")
        y.set_position(100.0, square=True).wait()
        move = y.move_absolute(300.0)
        cell.sleep(0.8)
        cell.simulated_node(2).drive().dials.blocked = True
        with suppress(AxisbusError):
            move.wait()
        cell.sleep(0.3)

    figure, rows = plt.subplots(
        2, 2, figsize=(10, 5.2), height_ratios=(2, 1), sharex="col", layout="constrained"
    )
    plays = (
        (beam(home, *switches), (-2.5, 3.0), "homed by two switches"),
        (beam(jam, 9e3, 9e3), (0.0, 2.0), "y2 jams"),
    )
    for column, ((times, first, second), (square, bound), title) in enumerate(plays):
        place, skew = rows[0][column], rows[1][column]
        place.plot(times, first, color=COLOURS[0], linewidth=1.5, label="motor of y1")
        place.plot(times, second, color=COLOURS[1], linewidth=1.3, linestyle="--", label="motor of y2")
        place.set(title=title, ylabel="mm")
        skew.plot(
            times,
            [b - a - square for a, b in zip(first, second, strict=True)],
            color=COLOURS[2],
            label="skew",
        )
        for edge in (bound, -bound):
            skew.axhline(edge, color="#888888", linewidth=0.8, linestyle=":")
        skew.set(xlabel="s", ylabel="skew in mm")
    for at, colour, name in zip(switches, COLOURS, ("y1", "y2"), strict=False):
        rows[0][0].axhline(at, color=colour, linewidth=0.7, linestyle=":")
        rows[0][0].annotate(f"switch of {name}", (0.02, at), fontsize=7, color=colour, va="bottom")
    for axes in rows[0]:
        axes.legend(fontsize=8)
    save(figure, "gantry.png")


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    for draw in (
        corners,
        override,
        override_axis,
        superimposed,
        blending,
        feed_forward,
        jerk,
        jerk_axis,
        jerk_path,
        jerk_velocity,
        gear,
        phase,
        cam,
        interpolated,
        controller,
        stream,
        workspace,
        gantry,
    ):
        draw()
        print(draw.__name__, flush=True)
