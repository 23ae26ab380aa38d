/** The benchmarks on which the choice of the twin's model is based. */
const CHART_FILES = import.meta.glob<string>("../../../../docs/charts/*.png", {
  eager: true,
  query: "?url",
  import: "default",
});

const addressOf = (name: string) =>
  Object.entries(CHART_FILES).find(([path]) => path.endsWith(`/${name}.png`))?.[1];

const CHARTS = [
  {
    name: "work-precision",
    title: "Speed against accuracy, beside other libraries",
    text:
      "CPU time per simulated second against the error of the ball's position, in six scenes. " +
      "Lower left is better.",
  },
  {
    name: "work-precision-models",
    title: "Speed against accuracy, model by model",
    text: "The models from small angles to rolling, creep, sliding, and contact with spring and damper.",
  },
  {
    name: "fidelity",
    title: "Choice of the model",
    text: "The cheapest model with the required accuracy in each scene.",
  },
  {
    name: "stability",
    title: "Stability of the methods",
    text: "Step size against stiffness: the region in which each method is stable.",
  },
  {
    name: "estimators",
    title: "Differentiating noisy positions",
    text: "Error against delay of filters that estimate the acceleration.",
  },
];

export function Benchmarks() {
  const charts = CHARTS.flatMap((chart) => {
    const address = addressOf(chart.name);
    return address ? [{ ...chart, address }] : [];
  });
  return (
    <section class="card" id="charts">
      <h2>Speed against accuracy</h2>
      <p>
        The twin runs the cheapest model that is accurate enough. The choice is based on these benchmarks;{" "}
        <code>offbd chart work-precision</code> repeats them on your machine.
      </p>
      {charts.length === 0 && (
        <p class="note">This build does not include the charts; they are in docs/charts of the repository.</p>
      )}
      <div class="gallery">
        {charts.map(({ title, text, address }) => (
          <figure>
            <a href={address} target="_blank" rel="noopener">
              <img src={address} alt={`${title}. ${text}`} loading="lazy" />
            </a>
            <figcaption>
              <b>{title}</b>
              <br />
              <span class="quiet">{text}</span>
            </figcaption>
          </figure>
        ))}
      </div>
    </section>
  );
}
