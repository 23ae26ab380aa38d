export const TextbookText = () => (
  <p>
    The profile <b>textbook</b> is the rule of a book (N. Khaled, B. Pattel, A. Siddiqui,{" "}
    <cite>Digital Twin Development and Deployment on the Cloud</cite>, 2020, chapter 4): report a fault if the
    measured and the simulated acceleration differ by 0.01 m/s². That works in a simulation without noise. The
    positions of a real camera have errors of a fraction of a millimetre; differentiated twice, they always
    exceed that limit by far. Below, a stretch without a fault is judged with both profiles: <b>default</b>,
    with a limit set from the noise and a debounce, and <b>textbook</b>, the rule to the letter: it judges
    only while the command exceeds 4.6° or the acceleration 0.5 m/s², and then raises an alarm at once.
  </p>
);
