import type { RefObject } from "preact";
import { useState } from "preact/hooks";
import type { ViewName } from "./orbit-camera";
import type { RigScene } from "./rig-scene";

const VIEWS: ViewName[] = ["free", "top", "along x", "along y"];

/** Buttons for the views of the camera and for the axes of the frames of reference. */
export function ViewButtons({ scene }: { scene: RefObject<RigScene | null> }) {
  const [view, setView] = useState<ViewName>("free");
  const [hasFrames, setFrames] = useState(true);
  const look = (wanted: ViewName) => {
    setView(wanted);
    scene.current?.look(wanted);
  };
  const toggleFrames = () => {
    setFrames(!hasFrames);
    scene.current?.setFrames(!hasFrames);
  };
  return (
    <>
      {VIEWS.map((each) => (
        <button type="button" class="small" aria-pressed={view === each} onClick={() => look(each)}>
          {each}
        </button>
      ))}
      <button type="button" class="small" aria-pressed={hasFrames} onClick={toggleFrames}>
        axes
      </button>
    </>
  );
}
