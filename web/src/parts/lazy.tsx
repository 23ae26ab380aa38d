/** Views that are loaded when they are first shown. */
import type { ComponentChildren, ComponentType, VNode } from "preact";
import { createContext } from "preact";
import { useContext, useEffect, useState } from "preact/hooks";

const Fallback = createContext<ComponentChildren>(null);

/** What is shown while a view inside is loading. */
export function Suspense({
  fallback,
  children,
}: {
  fallback: ComponentChildren;
  children: ComponentChildren;
}) {
  return <Fallback.Provider value={fallback}>{children}</Fallback.Provider>;
}

export function lazy<P extends object>(load: () => Promise<ComponentType<P>>): (props: P) => VNode {
  let loaded: ComponentType<P> | undefined;
  return function Lazy(props: P) {
    const [, shown] = useState(0);
    const [failed, setFailed] = useState(false);
    const fallback = useContext(Fallback);
    useEffect(() => {
      if (!loaded)
        load().then(
          (view) => {
            loaded = view;
            shown(1);
          },
          () => setFailed(true),
        );
    }, []);
    const View = loaded;
    if (failed)
      return (
        <main>
          <p class="trouble" role="alert">
            This part of the page cannot be loaded; the service may have been replaced by a newer one.{" "}
            <button type="button" onClick={() => location.reload()}>
              Load the page anew
            </button>
          </p>
        </main>
      );
    return View ? <View {...props} /> : <>{fallback}</>;
  };
}
