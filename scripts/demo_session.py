#!/usr/bin/python3
"""Runs demo.launch once: records a bag, shows progress, ends with the instruments' paths, and sums
up. Needs the environment of the built package and a free ROS_MASTER_URI; scripts/run sees to it.
Ends with 3 where the scalpel cut nothing off, with 1 where the demo itself did not come to its end."""
import argparse
import os
import signal
import subprocess
import sys
import time

import rosgraph
import rospy
from geometry_msgs.msg import WrenchStamped
from std_srvs.srv import SetBool, Trigger
from tissue_sim.msg import FluidArray, FragmentArray, SimulationState
from tissue_sim.srv import StartRecording

TOOLS = ("scalpel", "probe")
CRUMB = 4  # pieces of fewer points are crumbs that a blade leaves
CUT_OFF = 0.02  # share of a body that is at least cut off; less is a chip beside a cut that failed
CUT_FAILED = 3  # exit status
PATIENCE = 60.0  # seconds without progress after which something is wrong


class Failure(Exception):
    """What went wrong and what to do."""


class Session:
    """What the simulator says while the demo runs."""

    def __init__(self):
        self.start_over()
        rospy.Subscriber("/simulator/state", SimulationState, self.on_state)
        rospy.Subscriber("/simulator/fragments", FragmentArray, self.on_fragments)
        rospy.Subscriber("/simulator/fluids", FluidArray, self.on_fluids)
        for tool in TOOLS:
            rospy.Subscriber("/%s/spatial/measured_cf" % tool, WrenchStamped,
                             self.on_wrench, tool)

    def start_over(self):
        self.state, self.fragments, self.before, self.fluids = None, None, None, []
        self.peak, self.force = dict.fromkeys(TOOLS, 0.0), dict.fromkeys(TOOLS, 0.0)

    def on_state(self, message):
        self.state = message

    def on_fragments(self, message):
        self.before = self.before or message
        self.fragments = message

    def on_fluids(self, message):
        self.fluids = message.fluids

    def on_wrench(self, message, tool):
        f = message.wrench.force
        self.force[tool] = (f.x ** 2 + f.y ** 2 + f.z ** 2) ** 0.5
        self.peak[tool] = max(self.peak[tool], self.force[tool])


def wait_for(what, ready, launch, seconds=PATIENCE):
    end = time.monotonic() + seconds
    while not ready():
        if launch.poll() is not None:
            raise Failure("roslaunch ended while waiting for " + what)
        if time.monotonic() > end:
            raise Failure("no %s within %.0f s" % (what, seconds))
        time.sleep(0.1)


def call(name, kind, *arguments):
    """Calls a service of the simulator; raises Failure with its message if it says no."""
    try:
        answer = rospy.ServiceProxy("/simulator/" + name, kind)(*arguments)
    except rospy.ServiceException as e:
        raise Failure("service %s: %s" % (name, e))
    if not answer.success:
        raise Failure("service %s: %s" % (name, answer.message))
    return answer.message


def length_of(path):
    with open(path) as file:
        return float(file.read().rstrip().splitlines()[-1].split(",")[0])


def show(session, seconds):
    s = session.state
    done = min(1.0, s.time / seconds)
    pieces = sum(f.point_count >= CRUMB for f in session.fragments.fragments)
    line = "   [%-24s] %4.1f of %.1f s  %.2f x real time  scalpel %.2f N  probe %.2f N  %d piece%s" % (
        "#" * int(24 * done), s.time, seconds, s.real_time_factor, session.force["scalpel"],
        session.force["probe"], pieces, "" if pieces == 1 else "s")
    if sys.stdout.isatty():
        print("\r\033[K" + line, end="", flush=True)
    else:
        print(line, flush=True)


def follow(session, seconds, launch):
    """Until the simulated time has come, showing how far it is."""
    last, moved = -1.0, time.monotonic()
    pause = 0.2 if sys.stdout.isatty() else 2.0
    while session.state.time < seconds:
        if launch.poll() is not None:
            raise Failure("roslaunch ended before the demo did")
        if session.state.blew_up:
            raise Failure("the simulation blew up at %.2f s" % session.state.time)
        if session.state.time > last:
            last, moved = session.state.time, time.monotonic()
        elif time.monotonic() - moved > PATIENCE:
            raise Failure("the simulation stands still at %.2f s" % last)
        show(session, seconds)
        time.sleep(min(pause, max(0.05, seconds - session.state.time)))
    show(session, seconds)
    print()


def summary(session, wall):
    """The table at the end."""
    s = session.state
    lines = ["%-10s %8s %8s %8s %12s  %s" % ("piece", "id", "parent", "points", "volume", "")]
    for title, pieces in (("before", session.before), ("after", session.fragments)):
        for f in pieces.fragments:
            if f.point_count >= CRUMB:
                lines.append("%-10s %8d %8s %8d %8.2f cm3  %s" % (
                    title, f.id, "-" if f.parent < 0 else f.parent, f.point_count, f.volume * 1e6,
                    "loose" if f.loose else "held"))
        crumbs = [f for f in pieces.fragments if f.point_count < CRUMB]
        if crumbs:
            lines.append("%-10s %d of fewer than %d points, %.3f cm3 together" % (
                title, len(crumbs), CRUMB, sum(f.volume for f in crumbs) * 1e6))
    lines += ["%-15s %.2f cm3, %.2f of it ran out" % (f.name, f.total * 1e6, f.spilt * 1e6)
              for f in session.fluids]
    lines += ["peak force      scalpel %.3f N, probe %.3f N" % (session.peak["scalpel"],
                                                                 session.peak["probe"]),
              "real time       %.2f x (%.1f s simulated in %.1f s)" % (s.time / wall, s.time, wall),
              "frames          %d at %g Hz, %d substeps in the last" % (s.frame, s.frame_rate,
                                                                        s.substeps),
              "points          %d on %s" % (s.particles, s.device)]
    return "\n".join("   " + line.rstrip() for line in lines)


def not_loose(before, after):
    """What the scalpel was to cut off a piece of and did not, a line; None where it did."""
    whole = sum(f.point_count for f in before.fragments)
    known = {f.id for f in before.fragments}
    new = [f for f in after.fragments if f.id not in known and f.loose]
    largest = max((f.point_count for f in new), default=0)
    if largest >= CUT_OFF * whole:
        return None
    held = ", ".join("piece %d (%d points, %s)" % (f.id, f.point_count, "loose" if f.loose else "held")
                     for f in after.fragments if f.point_count >= CUT_OFF * whole)
    return ("the cut failed, a bridge of tissue still holds what was to come loose: %s; the largest "
            "bit that came off has %d points" % (held, largest))


def run(args, launch):
    """Returns what did not come loose, None if all did."""
    wait_for("ROS master", rosgraph.is_master_online, launch)
    rospy.init_node("demo_session", disable_signals=True)
    session = Session()
    for name in ("pause", "reset", "start_recording", "stop_recording"):
        wait_for("service " + name, lambda: has_service(name), launch)  # noqa: B023
    call("pause", SetBool, True)  # from the very start, with nothing missing in the bag
    call("reset", Trigger)
    session.start_over()
    call("start_recording", StartRecording, "demo.bag", [])
    started = time.monotonic()
    call("pause", SetBool, False)
    wait_for("state of the simulation", lambda: session.state and session.before, launch)
    seconds = max(length_of(os.path.join(args.paths, tool + ".csv")) for tool in TOOLS) + 0.3
    follow(session, seconds, launch)
    wall = time.monotonic() - started
    call("stop_recording", Trigger)
    text = summary(session, wall)
    failed = not_loose(session.before, session.fragments)
    if failed:
        text += "\n   " + failed
    print(text)
    with open(os.path.join(args.out, "summary.txt"), "w") as file:
        file.write(text + "\n")
    return failed


def has_service(name):
    try:
        rosgraph.Master("/demo_session").lookupService("/simulator/" + name)
        return True
    except (rosgraph.MasterException, OSError):  # the master is gone: wait_for() says so
        return False


def telling(lines):
    """What errors a log has, or its end where it has none."""
    return [line for line in lines if "[FATAL]" in line or "[ERROR]" in line] or lines[-12:]


def stop(launch):
    """Ends roslaunch and all that it started."""
    for kind, patience in ((signal.SIGINT, 20), (signal.SIGTERM, 5), (signal.SIGKILL, 5)):
        if launch.poll() is None:
            os.killpg(launch.pid, kind)
            try:
                launch.wait(patience)
            except subprocess.TimeoutExpired:
                continue


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    for option in ("--scene", "--paths", "--out"):
        parser.add_argument(option, required=True)
    parser.add_argument("--rviz", default="false")
    parser.add_argument("--method", default="", help="in place of the scene's")
    args = parser.parse_args()
    log = os.path.join(args.out, "roslaunch.log")
    port = os.environ["ROS_MASTER_URI"].rsplit(":", 1)[1].strip("/")
    command = ["/usr/bin/python3", find_roslaunch(), "-p", port, "tissue_sim", "demo.launch",
               "scene:=" + args.scene, "paths:=" + args.paths, "method:=" + args.method,
               "rviz:=" + args.rviz,
               "recording_folder:=" + args.out, "cloud_rate:=" + ("20" if args.rviz == "true" else "5")]
    print("   To look on: export ROS_MASTER_URI=%s; rostopic echo /simulator/state" %
          os.environ["ROS_MASTER_URI"], flush=True)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    with open(log, "w") as file:
        launch = subprocess.Popen(command, stdout=file, stderr=subprocess.STDOUT,
                                  stdin=subprocess.DEVNULL, start_new_session=True)
    failed = None
    try:
        failed = run(args, launch)
    except Failure as e:
        with open(log) as file:
            print("\n".join("   | " + line.rstrip() for line in telling(file.readlines())))
        sys.exit("error: %s: see %s" % (e, log))
    except KeyboardInterrupt:
        sys.exit("\nstopped; what was recorded so far is in %s" % args.out)
    finally:
        stop(launch)
    if failed:
        sys.exit(CUT_FAILED)


def find_roslaunch():
    for folder in os.environ["PATH"].split(":"):
        path = os.path.join(folder, "roslaunch")
        if os.path.exists(path):
            return path
    raise SystemExit("error: roslaunch is not on the PATH: start this through scripts/run")


if __name__ == "__main__":
    main()
