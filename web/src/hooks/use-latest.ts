import { useRef } from "preact/hooks";

/** A reference to the latest `value`, for callbacks that outlive the rendering that created them. */
export function useLatest<T>(value: T): { readonly current: T } {
  const latest = useRef(value);
  latest.current = value;
  return latest;
}
