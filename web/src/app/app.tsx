/** The frame of the page: header, current view and footer. */
import { api } from "../api/client";
import { useQuery } from "../hooks/use-query";
import { Suspense } from "../parts/lazy";
import { Loading } from "../parts/loading";
import { HealthContext } from "../parts/service-health";
import { useLocation } from "../router/navigation";
import { Header } from "./header";
import { Route } from "./route";

export function App() {
  const { segments } = useLocation();
  const health = useQuery(api.health, "health");
  const isDemo = health.data?.demo ?? false;
  const loading = (
    <main>
      <Loading what="the page" />
    </main>
  );
  return (
    <HealthContext.Provider value={health.data}>
      <a class="skip" href="#content">
        Skip to the content
      </a>
      <Header segments={segments} />
      <div id="content" tabIndex={-1}>
        <Suspense fallback={loading}>
          <Route segments={segments} isDemo={isDemo} />
        </Suspense>
      </div>
      <footer>
        <a href="/docs/" target="_blank" rel="noopener">
          API
        </a>
        <a href="/openapi.yaml">openapi.yaml</a>
        <a href="/metrics">Metrics</a>
        <span class="quiet">offbd {health.data?.version}</span>
      </footer>
    </HealthContext.Provider>
  );
}
