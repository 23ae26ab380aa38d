import { useRef } from "preact/hooks";

/** The latest `value`, for callbacks that outlive the rendering in which they were made. */
export function useLatest<T>(value: T): { readonly current: T } {
  const latest = useRef(value);
  latest.current = value;
  return latest;
}
