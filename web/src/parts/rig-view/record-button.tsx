import { useRef, useState } from "preact/hooks";
import { saveFile } from "../save-file";

/** Frames per second of a video. */
const VIDEO_HZ = 60;
const BITS_PER_SECOND = 8e6;
const FORMATS = ["video/webm;codecs=vp9", "video/webm", "video/mp4"];

/** Duration of the parts in which the recorder delivers the video, ms. */
const PART_MS = 1000;

/** `starting` until the first part has arrived. */
type Stage = "idle" | "starting" | "recording";

const LABELS: Record<Stage, string> = { idle: "● record", starting: "… starting", recording: "■ stop" };

/** Records the canvas as a video, which is downloaded when the recording is stopped. A video that
 * has no content yet is discarded instead. */
export function RecordButton({ canvas, name }: { canvas: () => HTMLCanvasElement | null; name: string }) {
  const recorder = useRef<MediaRecorder | null>(null);
  const [stage, setStage] = useState<Stage>("idle");
  if (typeof MediaRecorder === "undefined") return null;
  const start = () => {
    const mimeType = FORMATS.find((format) => MediaRecorder.isTypeSupported(format));
    const stream = canvas()!.captureStream(VIDEO_HZ);
    const current = new MediaRecorder(stream, { mimeType, videoBitsPerSecond: BITS_PER_SECOND });
    const parts: Blob[] = [];
    current.ondataavailable = ({ data }) => {
      if (data.size === 0) return;
      parts.push(data);
      setStage("recording");
    };
    current.onstop = () => {
      setStage("idle");
      if (parts.length === 0) return;
      const extension = current.mimeType.includes("mp4") ? "mp4" : "webm";
      saveFile(new Blob(parts, { type: current.mimeType }), `${name}.${extension}`);
    };
    current.start(PART_MS);
    recorder.current = current;
    setStage("starting");
  };
  const toggle = () => {
    if (recorder.current?.state === "recording") recorder.current.stop();
    else start();
  };
  return (
    <button type="button" class="small" aria-pressed={stage !== "idle"} onClick={toggle}>
      {LABELS[stage]}
    </button>
  );
}
