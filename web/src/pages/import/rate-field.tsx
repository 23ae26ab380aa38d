interface Props {
  rate: number | undefined;
  setRate: (rate: number | undefined) => void;
}

/** The rows a second of a file without a time. */
export function RateField({ rate, setRate }: Props) {
  return (
    <div class="form-row">
      <label>
        Rows per second{" "}
        <input
          type="number"
          min="0.001"
          step="any"
          value={rate ?? ""}
          onChange={(e) => setRate(e.currentTarget.valueAsNumber || undefined)}
        />
      </label>
    </div>
  );
}
