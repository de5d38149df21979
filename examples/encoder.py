"""An encoder as the master axis: a slide meets a part on a belt of another machine, moves along with it, and returns."""

from pathlib import Path

from axisbus import Machine

with Machine.simulated(Path(__file__).with_name("encoder.toml")) as cell:  # with hardware: Machine.open
    belt, slide = cell["belt"], cell["slide"]
    counter = cell.simulated_node(7).device.io  # the inputs of the simulated node

    def run_belt(until: float, speed: float = 100.0) -> None:
        """Move the simulated belt to a position (mm), at a speed in mm/s."""
        while belt.position < until:
            run_belt.place += speed * 0.004
            counter.set(0x6401, 1, round(20 * run_belt.place))
            cell.sleep(0.004)

    run_belt.place = 0.0
    slide.enable().wait()
    slide.home().wait()
    meeting = slide.gear_in(
        belt, 1.0, sync_positions=(150.0, 20.0), master_start_distance=80.0
    )  # it starts when the belt is at 70; when the belt is at 150, the slide is at 20
    run_belt(151.0)
    meeting.wait()
    run_belt(300.0)
    print("belt at", round(belt.position), "mm, slide at", round(slide.position), "mm, in step with the part")
    slide.move_absolute(0.0).wait()  # starts from the speed of the belt
    print("slide back at", round(slide.position, 1), "mm")
