"""Runs the drive cycle of drive-cycle.json and records it in drive-cycle-run.csv.

Put the ball near the middle of the plate, then start this program. To diagnose the recording:
    offbd replay --asset calibrated.json drive-cycle-run.csv
"""
import json, time

def read_rig():
    """To be written: returns the ball's x and y in the device's unit, None if it is not seen."""
    return 0.0, 0.0

def move_rig(qx, qy):
    """To be written: commands the plate angles; None if the rig has no such servo."""

class Correction:
    """A PID correction of one command by the distance of the ball from its set point."""

    def __init__(self, gains):
        self.gains, self.error, self.rate, self.sum, self.unseen, self.last = gains, None, 0.0, 0.0, 0.0, 0.0

    def __call__(self, error, dt):
        if error is None:
            self.error, self.rate, self.unseen = None, 0.0, self.unseen + dt
            if self.unseen > 0.3:              # no ball for long: no correction
                self.last = 0.0
            return self.last
        change = (error - self.error) / dt if self.error is not None and dt > 0 else 0.0
        self.rate += (change - self.rate) * dt / (cycle["filter_s"] + dt)
        limit = 0.5 * cycle["limit"]
        self.sum = max(-limit, min(limit, self.sum + self.gains["integral"] * error * dt))
        self.error, self.unseen = error, 0.0
        self.last = self.gains["proportional"] * error + self.sum + self.gains["derivative"] * self.rate
        return self.last

cycle = json.load(open("drive-cycle.json"))
rows = cycle["rows"]
corrections = {"qx": cycle["correct_qx"], "qy": cycle["correct_qy"]}
corrections = {name: Correction(gains) for name, gains in corrections.items() if gains}

def command(name, i, read, dt):
    """Returns the corrected command of row i, limited to the servo's range."""
    if name not in corrections:
        return None
    reading = "x_m" if corrections[name].gains["reads_x"] else "y_m"
    error = None if read[reading] is None else rows[reading][i] - read[reading]
    wanted = rows["cmd_%s_rad" % name][i] + corrections[name](error, dt)
    return max(-cycle["limit"], min(cycle["limit"], wanted))

def field(value):
    return "" if value is None else "%.6f" % value

with open("drive-cycle-run.csv", "w") as record:
    record.write("t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m\n")
    start, last = time.monotonic(), 0.0
    for i, t in enumerate(rows["t_s"]):
        time.sleep(max(0.0, start + t - time.monotonic()))
        now = time.monotonic() - start
        x, y = read_rig()
        qx, qy = (command(name, i, {"x_m": x, "y_m": y}, now - last) for name in ("qx", "qy"))
        move_rig(qx, qy)
        record.write(",".join(field(value) for value in (now, qx, qy, x, y)) + "\n")
        last = now
