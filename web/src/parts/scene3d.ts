/**
 * The plate and the ball in three dimensions, with the twin as a ghost. Frames
 * and signs are those of ARCHITECTURE.md: z up, the joint in the middle of the
 * plate's upper face, world from plate = Rx(qx)·Ry(qy). Loaded only where it is shown.
 */
import {
  AmbientLight,
  ArrowHelper,
  BoxGeometry,
  BufferGeometry,
  CanvasTexture,
  CircleGeometry,
  Color,
  ConeGeometry,
  CylinderGeometry,
  DirectionalLight,
  DoubleSide,
  EdgesGeometry,
  Float32BufferAttribute,
  Group,
  HemisphereLight,
  Line,
  LineBasicMaterial,
  LineSegments,
  Mesh,
  MeshBasicMaterial,
  MeshStandardMaterial,
  PerspectiveCamera,
  Scene,
  SphereGeometry,
  Sprite,
  SpriteMaterial,
  Vector3,
  WebGLRenderer,
} from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import type { Asset } from "../api/types";
import { colour, onTheme } from "../theme";

export interface Pose {
  /** Plate angles about x and y, rad. */
  qx: number;
  qy: number;
  ball: { x: number; y: number } | null;
  ghost: { x: number; y: number } | null;
}

export type ViewName = "free" | "top" | "along x" | "along y";

/** Moments of the ball's trail: 3 s at 60 frames a second. */
const TRAIL = 180;

export class RigScene {
  private readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  private readonly camera = new PerspectiveCamera(38, 1, 0.01, 20);
  private readonly controls: OrbitControls;
  private readonly plate = new Group();
  private readonly frames = new Group();
  private ball = new Group();
  private ghost = new Group();
  private trail!: Line<BufferGeometry, LineBasicMaterial>;
  /** Three numbers for each moment of the trail; one buffer for good, so that nothing piles up. */
  private readonly path = new Float32BufferAttribute(new Float32Array(TRAIL * 3), 3);
  private nPath = 0;
  private size = 0.4;
  private radius = 0.0127;
  private view: ViewName = "free";
  private isDirty = true;
  private readonly stop: (() => void)[] = [];

  constructor(
    readonly canvas: HTMLCanvasElement,
    private asset: Asset,
  ) {
    this.renderer = new WebGLRenderer({ canvas, antialias: true, preserveDrawingBuffer: false });
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enablePan = false;
    this.controls.maxPolarAngle = Math.PI * 0.55;
    this.controls.addEventListener("change", () => (this.isDirty = true));
    const resized = new ResizeObserver(() => this.resize());
    resized.observe(canvas.parentElement!);
    canvas.addEventListener("webglcontextrestored", () => this.build());
    this.stop.push(
      () => resized.disconnect(),
      onTheme(() => this.build()),
    );
    this.build();
    this.look("free");
  }

  destroy(): void {
    this.stop.forEach((stop) => stop());
    this.controls.dispose();
    this.renderer.dispose();
  }

  setFrames(shown: boolean): void {
    this.frames.visible = shown;
    this.plate.getObjectByName("frame")!.visible = shown;
    this.isDirty = true;
  }

  look(view: ViewName): void {
    // A narrow picture needs more distance to show the whole width.
    const d = this.size * 1.45 * Math.max(1, 1.25 / this.camera.aspect);
    this.view = view;
    const place = {
      free: [0.55 * d, -0.95 * d, 0.75 * d],
      top: [0, -0.001 * d, 1.35 * d],
      "along x": [-1.35 * d, 0, 0.12 * d],
      "along y": [0, -1.35 * d, 0.12 * d],
    }[view];
    this.camera.position.set(place[0]!, place[1]!, place[2]);
    this.controls.target.set(0, 0, 0);
    this.controls.update();
    this.isDirty = true;
  }

  /** Turns the camera about the plate: for keys. */
  turn(about: number, up: number): void {
    const offset = this.camera.position.clone().sub(this.controls.target);
    offset.applyAxisAngle(new Vector3(0, 0, 1), about);
    const side = new Vector3(-offset.y, offset.x, 0).normalize();
    const turned = offset.clone().applyAxisAngle(side, up);
    const height = turned.z / turned.length();
    if (height > -0.1 && height < 0.995) offset.copy(turned);
    this.camera.position.copy(this.controls.target).add(offset);
    this.controls.update();
    this.isDirty = true;
  }

  clearTrail(): void {
    this.nPath = 0;
  }

  show(pose: Pose): void {
    this.plate.rotation.set(pose.qx, pose.qy, 0, "XYZ");
    this.place(this.ball, pose.ball);
    this.place(this.ghost, pose.ghost);
    if (pose.ball) this.leaveTrail(pose.ball);
    this.isDirty = true;
  }

  private leaveTrail({ x, y }: { x: number; y: number }): void {
    const points = this.path.array;
    if (this.nPath === TRAIL) points.copyWithin(0, 3);
    else this.nPath++;
    this.path.setXYZ(this.nPath - 1, x, y, 0.0006);
    this.path.needsUpdate = true;
    this.trail.geometry.setDrawRange(0, this.nPath);
  }

  render(): void {
    if (!this.isDirty) return;
    this.isDirty = false;
    this.renderer.render(this.scene, this.camera);
  }

  private place(group: Group, at: Pose["ball"]): void {
    group.visible = at !== null;
    if (at) group.position.set(at.x, at.y, 0);
  }

  private resize(): void {
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement!;
    if (!width || !height) return;
    this.renderer.setSize(width, height, false);
    const before = this.camera.aspect;
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    if (Math.abs(before - this.camera.aspect) > 0.01) this.look(this.view);
    // A new size empties the canvas; it must not be seen empty.
    this.renderer.render(this.scene, this.camera);
  }

  private build(): void {
    this.scene.clear();
    this.plate.clear();
    this.frames.clear();
    this.scene.background = new Color(colour("stage"));
    this.scene.add(new AmbientLight(0xffffff, 0.7), new HemisphereLight(0xffffff, colour("stage"), 1.2));
    const sun = new DirectionalLight(0xffffff, 1.6);
    sun.position.set(0.4, -0.7, 1.2);
    this.scene.add(sun, this.plate, this.frames);
    this.buildPlate();
    this.buildBalls();
    this.buildFrames();
    this.resize();
  }

  private buildPlate(): void {
    const { plate, ball } = this.asset;
    const thickness = Math.max(plate?.thickness_m ?? 0, 0.004);
    const diameter = plate?.diameter_m;
    const [length, width] = diameter
      ? [diameter, diameter]
      : [plate?.length_m ?? 0.38, plate?.width_m ?? 0.24];
    this.size = Math.max(length, width);
    this.radius = ball?.radius_m ?? 0.0127;
    const shape = diameter
      ? new CylinderGeometry(diameter / 2, diameter / 2, thickness, 96).rotateX(Math.PI / 2)
      : new BoxGeometry(length, width, thickness);
    const slab = new Mesh(
      shape,
      new MeshStandardMaterial({ color: colour("plate"), roughness: 0.65, metalness: 0.1 }),
    );
    slab.position.z = -thickness / 2;
    const edges = new LineSegments(
      new EdgesGeometry(shape, 30),
      new LineBasicMaterial({ color: colour("edge") }),
    );
    edges.position.copy(slab.position);
    const foot = new Mesh(
      new ConeGeometry(this.size * 0.05, this.size * 0.22, 32),
      new MeshStandardMaterial({ color: colour("edge"), roughness: 0.8 }),
    );
    foot.rotation.x = Math.PI / 2;
    foot.position.z = -thickness - this.size * 0.11;
    this.scene.add(foot);
    this.plate.add(
      slab,
      edges,
      this.grid(length, width, Boolean(diameter)),
      frame(this.size * 0.22, "frame"),
    );
    const material = new LineBasicMaterial({ color: colour("measured"), transparent: true, opacity: 0.7 });
    this.trail = new Line(new BufferGeometry().setAttribute("position", this.path), material);
    this.trail.frustumCulled = false;
    this.trail.geometry.setDrawRange(0, this.nPath);
    this.plate.add(this.trail);
  }

  private grid(length: number, width: number, round: boolean): LineSegments {
    const step = 0.05,
      points: number[] = [];
    for (let x = -Math.floor(length / 2 / step) * step; x <= length / 2; x += step) {
      const reach = round ? Math.sqrt(Math.max((length / 2) ** 2 - x * x, 0)) : width / 2;
      points.push(x, -reach, 0.0002, x, reach, 0.0002);
    }
    for (let y = -Math.floor(width / 2 / step) * step; y <= width / 2; y += step) {
      const reach = round ? Math.sqrt(Math.max((width / 2) ** 2 - y * y, 0)) : length / 2;
      points.push(-reach, y, 0.0002, reach, y, 0.0002);
    }
    const geometry = new BufferGeometry().setAttribute("position", new Float32BufferAttribute(points, 3));
    return new LineSegments(
      geometry,
      new LineBasicMaterial({ color: colour("edge"), transparent: true, opacity: 0.35 }),
    );
  }

  private buildBalls(): void {
    const make = (name: string, ghost: boolean) => {
      const group = new Group();
      const material = new MeshStandardMaterial({
        color: colour(name),
        roughness: ghost ? 0.9 : 0.25,
        metalness: ghost ? 0 : 0.35,
        transparent: ghost,
        opacity: ghost ? 0.45 : 1,
        depthWrite: !ghost,
      });
      const sphere = new Mesh(new SphereGeometry(this.radius * (ghost ? 1.02 : 1), 40, 28), material);
      sphere.position.z = this.radius;
      const shadow = new Mesh(
        new CircleGeometry(this.radius * 0.8, 32),
        new MeshBasicMaterial({
          color: 0x000000,
          transparent: true,
          opacity: ghost ? 0.12 : 0.3,
          side: DoubleSide,
        }),
      );
      shadow.position.z = 0.0004;
      group.add(sphere, shadow);
      group.visible = false;
      return group;
    };
    this.ball = make("measured", false);
    this.ghost = make("twin", true);
    this.plate.add(this.ball, this.ghost);
  }

  /** The world's frame stands still below the plate's. */
  private buildFrames(): void {
    const world = frame(this.size * 0.22, "world", 0.45);
    world.position.set(-this.size * 0.62, -this.size * 0.45, -this.size * 0.22);
    this.frames.add(world);
  }
}

/** Three arrows: x red, y green, z blue, each with its letter. */
function frame(length: number, name: string, opacity = 1): Group {
  const group = new Group();
  group.name = name;
  const axes: [string, Vector3, number][] = [
    ["x", new Vector3(1, 0, 0), 0xdc2626],
    ["y", new Vector3(0, 1, 0), 0x16a34a],
    ["z", new Vector3(0, 0, 1), 0x2563eb],
  ];
  for (const [letter, direction, hue] of axes) {
    const arrow = new ArrowHelper(
      direction,
      new Vector3(0, 0, 0.0008),
      length,
      hue,
      length * 0.14,
      length * 0.07,
    );
    (arrow.line.material as LineBasicMaterial).opacity = opacity;
    const label = sign(name === "world" ? `${letter}₀` : letter, hue);
    label.position.copy(direction).multiplyScalar(length * 1.16);
    label.scale.setScalar(length * 0.3);
    group.add(arrow, label);
  }
  return group;
}

function sign(text: string, hue: number): Sprite {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = 64;
  const context = canvas.getContext("2d")!;
  context.font = "bold 42px system-ui, sans-serif";
  context.textAlign = "center";
  context.textBaseline = "middle";
  context.fillStyle = `#${hue.toString(16).padStart(6, "0")}`;
  context.fillText(text, 32, 34);
  return new Sprite(new SpriteMaterial({ map: new CanvasTexture(canvas), depthTest: false }));
}
