import { PerspectiveCamera, Vector3 } from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";

export type ViewName = "free" | "top" | "along x" | "along y";

/** Position of the camera in each view, in multiples of its distance. */
const POSITIONS: Record<ViewName, [number, number, number]> = {
  free: [0.55, -0.95, 0.75],
  top: [0, -0.001, 1.35],
  "along x": [-1.35, 0, 0.12],
  "along y": [0, -1.35, 0.12],
};

/** The camera, which orbits the plate by pointer and keys, and has named views. */
export class OrbitCamera {
  readonly camera = new PerspectiveCamera(38, 1, 0.01, 20);
  private readonly controls: OrbitControls;
  private view: ViewName = "free";

  /** `size` is the longer side of the plate, m. */
  constructor(
    canvas: HTMLCanvasElement,
    private readonly size: number,
    moved: () => void,
  ) {
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enablePan = false;
    this.controls.maxPolarAngle = Math.PI * 0.55;
    this.controls.addEventListener("change", moved);
  }

  dispose(): void {
    this.controls.dispose();
  }

  look(view: ViewName): void {
    this.view = view;
    // A narrow canvas needs more distance to show the whole width.
    const distance = this.size * 1.45 * Math.max(1, 1.25 / this.camera.aspect);
    this.camera.position.set(...POSITIONS[view]).multiplyScalar(distance);
    this.controls.target.set(0, 0, 0);
    this.controls.update();
  }

  /** Turns the camera around the plate and up or down, rad, but not below the plate or over the top. */
  turn(about: number, up: number): void {
    const offset = this.camera.position.clone().sub(this.controls.target);
    offset.applyAxisAngle(new Vector3(0, 0, 1), about);
    const side = new Vector3(-offset.y, offset.x, 0).normalize();
    const turned = offset.clone().applyAxisAngle(side, up);
    const height = turned.z / turned.length();
    if (height > -0.1 && height < 0.995) offset.copy(turned);
    this.camera.position.copy(this.controls.target).add(offset);
    this.controls.update();
  }

  setAspect(aspect: number): void {
    const before = this.camera.aspect;
    this.camera.aspect = aspect;
    this.camera.updateProjectionMatrix();
    if (Math.abs(before - aspect) > 0.01) this.look(this.view);
  }
}
