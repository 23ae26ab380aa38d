/** Numbers from 0 to 1 that look random and are the same in every run: the minimal standard generator. */
export function random(seed) {
  let state = seed;
  return () => (state = (state * 48_271) % 2_147_483_647) / 2_147_483_647;
}
