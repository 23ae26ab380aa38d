import { BufferGeometry, Float32BufferAttribute, Line, LineBasicMaterial } from "three";
import type { PlanePoint } from "../../live/pose";
import { colour } from "../../theme";

/** Number of points of the trail: 3 s at 60 frames per second. */
const LENGTH = 180;

/** Height of the trail above the plate, so that it is visible, m. */
const HEIGHT_M = 0.0006;

/** The trail of the ball on the plate. */
export class Trail {
  /** Three coordinates per point; one buffer that is never reallocated. */
  private readonly points = new Float32BufferAttribute(new Float32Array(LENGTH * 3), 3);
  private n = 0;
  private line?: Line;

  /** Builds the line with the colours of the current theme; keeps its points. */
  build(): Line {
    const material = new LineBasicMaterial({ color: colour("measured"), transparent: true, opacity: 0.7 });
    const line = new Line(new BufferGeometry().setAttribute("position", this.points), material);
    line.frustumCulled = false;
    line.geometry.setDrawRange(0, this.n);
    this.line = line;
    return line;
  }

  add({ x, y }: PlanePoint): void {
    if (this.n === LENGTH) this.points.array.copyWithin(0, 3);
    else this.n++;
    this.points.setXYZ(this.n - 1, x, y, HEIGHT_M);
    this.points.needsUpdate = true;
    this.line?.geometry.setDrawRange(0, this.n);
  }
}
