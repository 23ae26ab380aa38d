import { type RefObject } from "preact";
import { useEffect, useRef, useState } from "preact/hooks";
import type { Asset } from "../../api/types";
import { useLatest } from "../../hooks/use-latest";
import type { RigScene } from "./rig-scene";

/** Longest wait for the page to be idle, ms. */
const IDLE_MS = 1500;

/** Resolves when the page is idle. */
const idle = () =>
  new Promise<void>((resume) => {
    if ("requestIdleCallback" in window) requestIdleCallback(() => resume(), { timeout: IDLE_MS });
    else setTimeout(resume, IDLE_MS / 5);
  });

/** The scene on `canvas`: loaded when the page is idle, rebuilt when the shape of the rig changes. */
export function useScene(canvas: RefObject<HTMLCanvasElement | null>, asset: Asset) {
  const scene = useRef<RigScene | null>(null);
  const [state, setState] = useState<"loading" | "shown" | "failed">("loading");
  const shape = JSON.stringify([asset.plate, asset.ball]);
  const latestAsset = useLatest(asset);
  useEffect(() => {
    let isGone = false;
    const load = async () => {
      // Text and controls come first: the code of the scene is large.
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
