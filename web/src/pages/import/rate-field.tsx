import { useDraft } from "../../hooks/use-draft";

interface Props {
  rate: number | undefined;
  setRate: (rate: number | undefined) => void;
}

/** The rows a second of a file without a time. */
export function RateField({ rate, setRate }: Props) {
  const typed = useDraft(String(rate ?? ""), (text) => setRate(Number(text) || undefined));
  return (
    <div class="form-row">
      <label>
        Rows per second <input type="number" min="0.001" step="any" {...typed} />
      </label>
    </div>
  );
}
