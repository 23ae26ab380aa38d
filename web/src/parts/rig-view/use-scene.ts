import { type RefObject } from "preact";
import { useEffect, useRef, useState } from "preact/hooks";
import type { Asset } from "../../api/types";
import { useLatest } from "../../hooks/use-latest";
import type { RigScene } from "./rig-scene";

/** Longest wait for a moment in which the page has nothing else to do, ms. */
const IDLE_MS = 1500;

/** The next moment in which the page has nothing else to do. */
const idle = () =>
  new Promise<void>((resume) => {
    if ("requestIdleCallback" in window) requestIdleCallback(() => resume(), { timeout: IDLE_MS });
    else setTimeout(resume, IDLE_MS / 5);
  });

/** The scene on `canvas`: loaded when the page is idle, built anew when the rig's shape changes. */
export function useScene(canvas: RefObject<HTMLCanvasElement | null>, asset: Asset) {
  const scene = useRef<RigScene | null>(null);
  const [state, setState] = useState<"loading" | "shown" | "failed">("loading");
  const shape = JSON.stringify([asset.plate, asset.ball]);
  const latestAsset = useLatest(asset);
  useEffect(() => {
    let isGone = false;
    const load = async () => {
      // First what can be read and pressed, then what takes long to load.
      await idle();
      const { RigScene } = await import("./rig-scene");
      if (isGone) return;
      scene.current = new RigScene(canvas.current!, latestAsset.current);
      setState("shown");
    };
    load().catch(() => setState("failed"));
    return () => {
      isGone = true;
      scene.current?.destroy();
      scene.current = null;
    };
  }, [shape, canvas, latestAsset]);
  return { scene, state };
}
