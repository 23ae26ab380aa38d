/** The three-dimensional view in its frame: loaded when shown, moved by keys, recorded as a video. */
import { useEffect, useRef, useState } from "preact/hooks";
import type { Asset } from "../api/types";
import type { Pose, RigScene, ViewName } from "./scene3d";
import { useFrames } from "../hooks";
import { degrees } from "../words";

const VIEWS: ViewName[] = ["free", "top", "along x", "along y"];

/** Size of a step by an arrow key, rad. */
const STEP = 0.12;

/** Longest wait for a moment in which the page has nothing else to do, ms. */
const REST_MS = 1500;

const rested = () =>
  new Promise<void>((go) => {
    if ("requestIdleCallback" in window) requestIdleCallback(() => go(), { timeout: REST_MS });
    else setTimeout(go, REST_MS / 5);
  });

interface Props {
  asset: Asset;
  /** The pose to show now; asked before each frame. */
  pose: () => Pose | null;
  /** What a video file is called. */
  name: string;
}

export function RigView({ asset, pose, name }: Props) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const scene = useRef<RigScene | null>(null);
  const readout = useRef<HTMLOutputElement>(null);
  const [state, setState] = useState<"loading" | "shown" | "failed">("loading");
  const [frames, setFrames] = useState(true);
  const [view, setView] = useState<ViewName>("free");
  const shape = JSON.stringify([asset.plate, asset.ball]);

  useEffect(() => {
    let gone = false;
    // First what can be read and pressed, then what takes long to load.
    rested()
      .then(() => import("./scene3d"))
      .then(({ RigScene }) => {
        if (gone) return;
        scene.current = new RigScene(canvas.current!, asset);
        setState("shown");
      })
      .catch(() => setState("failed"));
    return () => {
      gone = true;
      scene.current?.destroy();
      scene.current = null;
    };
  }, [shape]);

  const asked = useRef(pose);
  asked.current = pose;
  const lastWords = useRef(0);
  useFrames((now) => {
    const shown = asked.current();
    if (shown) scene.current?.show(shown);
    scene.current?.render();
    if (shown && readout.current && now - lastWords.current > 120) {
      lastWords.current = now;
      readout.current.textContent = `twin's plate: qx ${degrees(shown.qx)}  qy ${degrees(shown.qy)}`;
    }
  });

  const choose = (wanted: ViewName) => {
    setView(wanted);
    scene.current?.look(wanted);
  };
  const keys: Record<string, [number, number]> = {
    ArrowLeft: [-STEP, 0],
    ArrowRight: [STEP, 0],
    ArrowUp: [0, -STEP],
    ArrowDown: [0, STEP],
  };
  const pressed = (event: KeyboardEvent) => {
    const step = keys[event.key];
    if (!step) return;
    event.preventDefault();
    scene.current?.turn(...step);
  };
  return (
    <div class="stage">
      <canvas
        ref={canvas}
        tabIndex={0}
        onKeyDown={pressed}
        role="img"
        aria-label="Plate and ball in three dimensions; the twin is the see-through ball. Arrow keys turn the view."
      />
      {state === "failed" && (
        <p class="stage-note">This browser shows no 3D (WebGL). The charts have all of it.</p>
      )}
      {state === "loading" && <p class="stage-note">Loading 3D…</p>}
      <output ref={readout} class="stage-tilt" aria-label="Tilt of the twin's plate">
        qx – qy –
      </output>
      <p class="stage-keys" aria-hidden="true">
        <span class="key key-measured">measured</span>
        <span class="key key-twin">twin</span>
      </p>
      <div class="stage-tools">
        {VIEWS.map((each) => (
          <button type="button" class="small" aria-pressed={view === each} onClick={() => choose(each)}>
            {each}
          </button>
        ))}
        <button
          type="button"
          class="small"
          aria-pressed={frames}
          onClick={() => {
            setFrames(!frames);
            scene.current?.setFrames(!frames);
          }}
        >
          frames
        </button>
        <RecordButton canvas={() => canvas.current} name={name} />
      </div>
    </div>
  );
}

/** Frames a second of a video. */
const VIDEO_HZ = 60;
const FORMATS = ["video/webm;codecs=vp9", "video/webm", "video/mp4"];

function RecordButton({ canvas, name }: { canvas: () => HTMLCanvasElement | null; name: string }) {
  const recorder = useRef<MediaRecorder | null>(null);
  const [recording, setRecording] = useState(false);
  if (typeof MediaRecorder === "undefined") return null;
  const toggle = () => {
    if (recorder.current?.state === "recording") return recorder.current.stop();
    const type = FORMATS.find((format) => MediaRecorder.isTypeSupported(format));
    const parts: Blob[] = [];
    const current = (recorder.current = new MediaRecorder(canvas()!.captureStream(VIDEO_HZ), {
      mimeType: type,
      videoBitsPerSecond: 8e6,
    }));
    current.ondataavailable = (event) => parts.push(event.data);
    current.onstop = () => {
      setRecording(false);
      save(
        new Blob(parts, { type: current.mimeType }),
        `${name}.${current.mimeType.includes("mp4") ? "mp4" : "webm"}`,
      );
    };
    current.start(1000);
    setRecording(true);
  };
  return (
    <button type="button" class="small" aria-pressed={recording} onClick={toggle}>
      {recording ? "■ stop" : "● record"}
    </button>
  );
}

export function save(content: Blob, name: string): void {
  const url = URL.createObjectURL(content);
  Object.assign(document.createElement("a"), { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
}
