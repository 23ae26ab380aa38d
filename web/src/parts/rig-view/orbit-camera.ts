import { PerspectiveCamera, Vector3 } from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";

export type ViewName = "free" | "top" | "along x" | "along y";

/** Where the camera stands in each view, in multiples of its distance. */
const PLACES: Record<ViewName, [number, number, number]> = {
  free: [0.55, -0.95, 0.75],
  top: [0, -0.001, 1.35],
  "along x": [-1.35, 0, 0.12],
  "along y": [0, -1.35, 0.12],
};

/** The camera, moved about the plate by the pointer, by keys, and to views that have a name. */
export class OrbitCamera {
  readonly camera = new PerspectiveCamera(38, 1, 0.01, 20);
  private readonly controls: OrbitControls;
  private view: ViewName = "free";

  /** `size` is the longer side of what is looked at, m. */
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
    // A narrow picture needs more distance to show the whole width.
    const distance = this.size * 1.45 * Math.max(1, 1.25 / this.camera.aspect);
    this.camera.position.set(...PLACES[view]).multiplyScalar(distance);
    this.controls.target.set(0, 0, 0);
    this.controls.update();
  }

  /** Turns about the plate, and up or down unless that leads below it or over the top, rad. */
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
