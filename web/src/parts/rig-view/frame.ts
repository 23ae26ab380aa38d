import {
  ArrowHelper,
  CanvasTexture,
  Group,
  type LineBasicMaterial,
  Sprite,
  SpriteMaterial,
  Vector3,
} from "three";

const AXES: [letter: string, direction: Vector3, hue: number][] = [
  ["x", new Vector3(1, 0, 0), 0xdc2626],
  ["y", new Vector3(0, 1, 0), 0x16a34a],
  ["z", new Vector3(0, 0, 1), 0x2563eb],
];

/** Builds a frame of reference: arrows x red, y green, z blue, labelled with letter and `suffix`. */
export function buildFrame(length: number, suffix = "", opacity = 1): Group {
  const group = new Group();
  for (const [letter, direction, hue] of AXES) {
    const origin = new Vector3(0, 0, 0.0008);
    const arrow = new ArrowHelper(direction, origin, length, hue, length * 0.14, length * 0.07);
    (arrow.line.material as LineBasicMaterial).opacity = opacity;
    const label = buildLabel(letter + suffix, hue);
    label.position.copy(direction).multiplyScalar(length * 1.16);
    label.scale.setScalar(length * 0.3);
    group.add(arrow, label);
  }
  return group;
}

function buildLabel(text: string, hue: number): Sprite {
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
