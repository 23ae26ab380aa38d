/** Measured beforehand: what the twin's choice of model is made from. */
const PICTURES = import.meta.glob<string>("../../../../docs/charts/*.png", {
  eager: true,
  query: "?url",
  import: "default",
});

const addressOf = (name: string) =>
  Object.entries(PICTURES).find(([path]) => path.endsWith(`/${name}.png`))?.[1];

const CHARTS = [
  {
    name: "work-precision",
    title: "Speed against accuracy, beside other libraries",
    text:
      "CPU time for a simulated second against the error of the ball's position, on six scenes. " +
      "Down and left is better.",
  },
  {
    name: "work-precision-models",
    title: "Speed against accuracy, model by model",
    text: "The ladder from small angles over rolling, creeping and sliding to spring and damper.",
  },
  {
    name: "fidelity",
    title: "Which model where",
    text: "The cheapest model that keeps within the wanted accuracy, by scene.",
  },
  {
    name: "stability",
    title: "Where methods break",
    text: "Step against stiffness: where each method stays stable.",
  },
  {
    name: "estimators",
    title: "How to differentiate noise",
    text: "Error against delay of the filters that could measure acceleration.",
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
        The twin runs the cheapest model that is good enough. What that choice is made from was measured;{" "}
        <code>offbd chart work-precision</code> measures it on your machine.
      </p>
      {charts.length === 0 && (
        <p class="note">
          This program was built without the pictures; they are in docs/charts of the repository.
        </p>
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
