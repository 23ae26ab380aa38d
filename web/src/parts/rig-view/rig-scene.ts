/**
 * The plate and the ball in 3D, with the twin's ball as a ghost. Frames and signs are those of
 * docs/notation.md: z up, the joint in the centre of the plate's upper face, world from plate =
 * Rx(qx)·Ry(qy). Loaded only when it is shown.
 */
import { AmbientLight, Color, DirectionalLight, Group, HemisphereLight, Scene, WebGLRenderer } from "three";
import type { Asset } from "../../api/types";
import type { PlanePoint, Pose } from "../../live/pose";
import { ballRadius, plateSize } from "../../live/rig-size";
import { colour, onTheme } from "../../theme";
import { buildBall } from "./ball";
import { buildFrame } from "./frame";
import { OrbitCamera, type ViewName } from "./orbit-camera";
import { buildFoot, buildPlate } from "./plate";
import { Trail } from "./trail";

export class RigScene {
  private readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  private readonly camera: OrbitCamera;
  private readonly plate = new Group();
  private readonly worldFrame = new Group();
  private readonly trail = new Trail();
  /** The longer side of the plate, m; scales everything else. */
  private readonly size: number;
  private plateFrame = new Group();
  private ball = new Group();
  private ghost = new Group();
  private shown: Pose | null = null;
  /** Whether anything has changed since the last rendering. */
  private isDirty = true;
  private readonly cleanups: (() => void)[] = [];

  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly asset: Asset,
  ) {
    const { length, width } = plateSize(asset);
    this.size = Math.max(length, width);
    this.renderer = new WebGLRenderer({ canvas, antialias: true, preserveDrawingBuffer: false });
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.camera = new OrbitCamera(canvas, this.size, () => (this.isDirty = true));
    const resized = new ResizeObserver(() => this.resize());
    resized.observe(canvas.parentElement!);
    canvas.addEventListener("webglcontextrestored", () => this.build());
    this.cleanups.push(
      () => resized.disconnect(),
      onTheme(() => this.build()),
    );
    this.build();
    this.look("free");
  }

  destroy(): void {
    this.cleanups.forEach((cleanup) => cleanup());
    this.camera.dispose();
    this.renderer.dispose();
  }

  setFrames(isShown: boolean): void {
    this.worldFrame.visible = isShown;
    this.plateFrame.visible = isShown;
    this.isDirty = true;
  }

  look(view: ViewName): void {
    this.camera.look(view);
    this.isDirty = true;
  }

  /** Turns the camera around the plate, rad. */
  turn(about: number, up: number): void {
    this.camera.turn(about, up);
    this.isDirty = true;
  }

  show(pose: Pose): void {
    if (isSame(pose, this.shown)) return;
    this.shown = pose;
    this.plate.rotation.set(pose.qx, pose.qy, 0, "XYZ");
    move(this.ball, pose.ball);
    move(this.ghost, pose.ghost);
    if (pose.ball) this.trail.add(pose.ball);
    this.isDirty = true;
  }

  render(): void {
    if (!this.isDirty) return;
    this.isDirty = false;
    this.renderer.render(this.scene, this.camera.camera);
  }

  private resize(): void {
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement!;
    if (!width || !height) return;
    this.renderer.setSize(width, height, false);
    this.camera.setAspect(width / height);
    // Resizing clears the canvas, so it is drawn at once.
    this.renderer.render(this.scene, this.camera.camera);
  }

  /** Builds everything in the scene with the colours of the current theme. */
  private build(): void {
    this.scene.clear();
    this.plate.clear();
    this.worldFrame.clear();
    this.scene.background = new Color(colour("stage"));
    this.scene.add(new AmbientLight(0xffffff, 0.7), new HemisphereLight(0xffffff, colour("stage"), 1.2));
    const sun = new DirectionalLight(0xffffff, 1.6);
    sun.position.set(0.4, -0.7, 1.2);
    this.scene.add(sun, this.plate, this.worldFrame, buildFoot(this.asset, this.size));
    this.plateFrame = buildFrame(this.size * 0.22);
    this.plateFrame.visible = this.worldFrame.visible;
    this.plate.add(...buildPlate(this.asset), this.plateFrame, this.trail.build());
    this.ball = buildBall("ball", ballRadius(this.asset));
    this.ghost = buildBall("ghost", ballRadius(this.asset));
    this.plate.add(this.ball, this.ghost);
    // The world frame is fixed, below the plate frame.
    const world = buildFrame(this.size * 0.22, "₀", 0.45);
    world.position.set(-this.size * 0.62, -this.size * 0.45, -this.size * 0.22);
    this.worldFrame.add(world);
    const { shown } = this;
    this.shown = null;
    if (shown) this.show(shown);
    this.resize();
  }
}

const isSamePoint = (a: PlanePoint | null, b: PlanePoint | null) => a?.x === b?.x && a?.y === b?.y;

const isSame = (a: Pose, b: Pose | null) =>
  a.qx === b?.qx && a.qy === b.qy && isSamePoint(a.ball, b.ball) && isSamePoint(a.ghost, b.ghost);

function move(ball: Group, to: PlanePoint | null): void {
  ball.visible = to !== null;
  if (to) ball.position.set(to.x, to.y, 0);
}
