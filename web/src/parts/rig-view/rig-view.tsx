import { useRef } from "preact/hooks";
import type { Asset } from "../../api/types";
import { useAnimationFrame } from "../../hooks/use-animation-frame";
import type { Pose } from "../../live/pose";
import { degrees } from "../../words/numbers";
import { RecordButton } from "./record-button";
import { useScene } from "./use-scene";
import { ViewButtons } from "./view-buttons";

/** Rotation per press of an arrow key, rad. */
const STEP = 0.12;

/** Rotation of the camera around the plate and up by each arrow key. */
const KEYS: Record<string, [about: number, up: number]> = {
  ArrowLeft: [-STEP, 0],
  ArrowRight: [STEP, 0],
  ArrowUp: [0, -STEP],
  ArrowDown: [0, STEP],
};

/** Shortest interval between two updates of the tilt text, so that it is readable, ms. */
const TEXT_MS = 120;

interface Props {
  asset: Asset;
  /** Returns the pose to show; called before each frame. */
  pose: () => Pose | null;
  /** Name of a video file without its extension. */
  name: string;
}

/** The 3D view with its controls; it is loaded when it is shown. */
export function RigView({ asset, pose, name }: Props) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const tilt = useRef<HTMLOutputElement>(null);
  const { scene, state } = useScene(canvas, asset);
  const writtenAt = useRef(0);
  useAnimationFrame((now) => {
    const shown = pose();
    if (shown) scene.current?.show(shown);
    scene.current?.render();
    if (shown && tilt.current && now - writtenAt.current > TEXT_MS) {
      writtenAt.current = now;
      tilt.current.textContent = `twin's plate: qx ${degrees(shown.qx)}  qy ${degrees(shown.qy)}`;
    }
  });
  const turn = (event: KeyboardEvent) => {
    const step = KEYS[event.key];
    if (!step) return;
    event.preventDefault();
    scene.current?.turn(...step);
  };
  return (
    <div class="stage">
      <canvas
        ref={canvas}
        tabIndex={0}
        onKeyDown={turn}
        role="img"
        aria-label="Plate and ball in 3D; the translucent ball is the twin's. Arrow keys rotate the view."
      />
      {state === "failed" && (
        <p class="stage-note">
          The 3D view, which needs WebGL, could not be loaded. The charts show the same data.
        </p>
      )}
      {state === "loading" && <p class="stage-note">Loading 3D…</p>}
      <output ref={tilt} class="stage-tilt" aria-label="Tilt of the twin's plate">
        {"qx –  qy –"}
      </output>
      <p class="stage-keys" aria-hidden="true">
        <span class="key key-measured">measured</span>
        <span class="key key-twin">twin</span>
      </p>
      <div class="stage-tools">
        <ViewButtons scene={scene} />
        <RecordButton canvas={() => canvas.current} name={name} />
      </div>
    </div>
  );
}
