"""An encoder as a master: a slide meets a part on a belt that another machine drives, goes along with it, and comes back."""

from pathlib import Path

from axisbus import Machine

with Machine.simulated(Path(__file__).with_name("encoder.toml")) as cell:  # with hardware: Machine.open
    belt, slide = cell["belt"], cell["slide"]
    counter = cell.simulated_node(7).device.io  # what is wired to the simulated node

    def run_belt(until: float, speed: float = 100.0) -> None:
        """Let the belt go to a place (mm): here, nobody else does."""
        while belt.position < until:
            run_belt.place += speed * 0.004
            counter.set(0x6401, 1, round(20 * run_belt.place))
            cell.sleep(0.004)

    run_belt.place = 0.0
    slide.enable().wait()
    slide.home().wait()
    meeting = slide.gear_in(
        belt, 1.0, sync_positions=(150.0, 20.0), master_start_distance=80.0
    )  # from 70 on; where the belt is at 150 it is at 20
    run_belt(151.0)
    meeting.wait()
    run_belt(300.0)
    print("belt at", round(belt.position), "mm, slide at", round(slide.position), "mm: in step with the part")
    slide.move_absolute(0.0).wait()  # takes over from the speed of the belt
    print("slide back at", round(slide.position, 1), "mm")
