/** Views that are loaded when they are first shown; a small part of preact/compat. */
import type { ComponentChildren, ComponentType, VNode } from "preact";
import { createContext } from "preact";
import { useContext, useEffect, useState } from "preact/hooks";
import { LoadFailed } from "./load-failed";

const Fallback = createContext<ComponentChildren>(null);

/** Shows `fallback` while a lazy view inside is loading. */
export function Suspense({
  fallback,
  children,
}: {
  fallback: ComponentChildren;
  children: ComponentChildren;
}) {
  return <Fallback.Provider value={fallback}>{children}</Fallback.Provider>;
}

/** How the code of each lazy component is loaded. */
const loaders = new Map<unknown, () => Promise<unknown>>();

/** Starts to load the code of `view`, if it is a lazy one that is not loaded. */
export function preload(view: VNode): void {
  // What fails is loaded again at the first rendering.
  loaders
    .get(view.type)?.()
    .catch(() => undefined);
}

/** Returns a component whose code is loaded by `load` at its first rendering. */
export function lazy<P extends object>(load: () => Promise<ComponentType<P>>): (props: P) => VNode {
  let loaded: ComponentType<P> | undefined;
  function Lazy(props: P) {
    const [, setShown] = useState(false);
    const [hasFailed, setFailed] = useState(false);
    const fallback = useContext(Fallback);
    useEffect(() => {
      if (loaded) return;
      const show = (component: ComponentType<P>) => {
        loaded = component;
        setShown(true);
      };
      load().then(show, () => setFailed(true));
    }, []);
    const View = loaded;
    if (hasFailed) return <LoadFailed />;
    return View ? <View {...props} /> : <>{fallback}</>;
  }
  loaders.set(Lazy, load);
  return Lazy;
}
