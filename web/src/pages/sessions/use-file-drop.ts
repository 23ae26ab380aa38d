import { useLayoutEffect, useState } from "preact/hooks";
import { useLatest } from "../../hooks/use-latest";

/** A file to import. */
export interface Dropped {
  file: File;
  /** Number of files that were dropped with it, which are not taken. */
  nOthers: number;
}

const hasFiles = (event: DragEvent) => event.dataTransfer?.types.includes("Files") ?? false;

/**
 * Passes the first of the files that are dropped anywhere on the page to `take`; returns whether one is being
 * dragged over it.
 */
export function useFileDrop(take: (dropped: Dropped) => void): boolean {
  const [isOver, setOver] = useState(false);
  const latestTake = useLatest(take);
  // A layout effect, as an effect after the paint would miss a file that is dropped immediately.
  useLayoutEffect(() => {
    const dragOver = (event: DragEvent) => {
      if (!hasFiles(event)) return;
      event.preventDefault();
      setOver(true);
    };
    const dragLeave = (event: DragEvent) => {
      if (!event.relatedTarget) setOver(false);
    };
    const drop = (event: DragEvent) => {
      event.preventDefault();
      setOver(false);
      const files = event.dataTransfer?.files;
      if (files?.[0]) latestTake.current({ file: files[0], nOthers: files.length - 1 });
    };
    addEventListener("dragover", dragOver);
    addEventListener("dragleave", dragLeave);
    addEventListener("drop", drop);
    return () => {
      removeEventListener("dragover", dragOver);
      removeEventListener("dragleave", dragLeave);
      removeEventListener("drop", drop);
    };
  }, [latestTake]);
  return isOver;
}
