/** What the codes and kinds of fault of the service are called on the page. */

const CODE: Record<string, { title: string; meaning: string }> = {
  x_servo: { title: "X servo", meaning: "moves the ball along x: turns the plate about y (qy)" },
  y_servo: { title: "Y servo", meaning: "moves the ball along y: turns the plate about x (qx)" },
  stuck_ball: { title: "Stuck ball", meaning: "the ball does not roll where the plate asks it to" },
  sensor: { title: "Position sensor", meaning: "measures where the ball is" },
};

const KIND: Record<string, string> = {
  dead: "no power: the plate has gone back to zero",
  held: "stays where it is",
  hold: "stays where it is",
  gain: "moves too little or too much",
  reversed: "moves the wrong way round",
  offset: "off by a constant angle, as with a slipped horn",
  slow: "follows far too slowly",
  intermittent: "comes and goes, as with a loose contact",
  frozen: "repeats its last reading",
  freeze: "repeats its last reading",
  dropout: "gives no readings",
  noise: "is far noisier than learnt",
  spikes: "gives lone readings far off",
  jump: "is off by a constant shift",
  glued: "fixed to the plate",
  sticky: "moves only on a large tilt",
};

export const codeTitle = (code: string) => CODE[code]?.title ?? code.replaceAll("_", " ");
export const codeMeaning = (code: string) => CODE[code]?.meaning ?? "";
export const kindMeaning = (kind?: string | null) =>
  kind ? (KIND[kind] ?? kind.replaceAll("_", " ")) : "the evidence does not say in which way";
export const faultTitle = (code: string, kind?: string | null) => codeTitle(code) + (kind ? `, ${kind}` : "");
