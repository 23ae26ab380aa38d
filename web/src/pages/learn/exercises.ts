/** The three applications of the book's chapter as exercises. */
import type { Session } from "../../api/types";

export interface Exercise {
  title: string;
  steps: string[];
  /** What is seen if it has been done. */
  seen: string;
  /** The same on the command line. */
  commands: string[];
  /** Whether a session suits the exercise. */
  suits: (session: Session) => boolean;
}

const isFaultless = ({ verdict }: Session) => verdict?.faults.length === 0;
const hasXServoFault = ({ verdict }: Session) => verdict?.faults.includes("x_servo") ?? false;

export const EXERCISES: Exercise[] = [
  {
    title: "1. Control: bring the ball to the centre",
    steps: [
      "Open the session and show 10 s.",
      "Compare the charts of the command and of the position along one axis.",
      "Go on with a push: run the second command.",
    ],
    seen:
      "The command leads the position: the plate tilts against the ball's motion before the ball turns " +
      "round. The twin follows the command alone, and its path stays beside the measured one.",
    commands: ["offbd scene pid", "offbd scene pid-impulse"],
    suits: isFaultless,
  },
  {
    title: "2. Models: a cube rests where a ball rolls",
    steps: [
      "Run the command, which puts a cube beside the ball on the tilted plate.",
      "Open the session, go to its rig, and read the plant model of the twin and the reason for it.",
    ],
    seen:
      "Friction (0.6) holds the cube up to a tilt of 31°, and the plate tilts by 12.7°. The ball rolls: " +
      "as it also begins to rotate, it takes 1 / (1 + 0.4) = 5/7 of the pull of gravity along the plate. " +
      "The twin uses the cheapest model that is accurate enough.",
    commands: ["offbd scene block"],
    suits: () => true,
  },
  {
    title: "3. Diagnosis: which limit finds the fault and nothing else",
    steps: [
      "Open the session and choose the profile textbook under “Judged by”.",
      "Open the histogram and compare the residual with the limit.",
      "Under “Try other limits”, raise the limits and the debounce of both servos until only the fault is left.",
    ],
    seen:
      "At 0.01 m/s² nearly everything is an alarm. A wide limit without debounce still reports a push, " +
      "and debounce alone does not help where the limit lies within the noise. The y servo is the " +
      "check: it has no fault.",
    commands: ["offbd scene good-asset", "offbd scene bad-x-servo"],
    suits: hasXServoFault,
  },
];

/** Returns the newest ended session that suits an exercise; sessions are given with the newest first. */
export const sessionFor = ({ suits }: Exercise, sessions: Session[]): Session | undefined =>
  sessions.find((session) => session.state === "ended" && session.samples > 0 && suits(session));
