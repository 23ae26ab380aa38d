export const TextbookText = () => (
  <p>
    The book chapter's rule calls it a fault when measured and simulated acceleration differ by 0.01 m/s². On
    a simulation without noise that works. A camera that sees the ball to a fraction of a millimetre,
    differentiated twice, is off by far more than that, all the time. Below, one session without a fault,
    judged by both: by the profile <b>default</b>, whose limit follows from the noise and which waits until a
    deviation lasts, and by <b>textbook</b>, the rule to the letter: it looks only while the command is beyond
    4.6° or the acceleration beyond 0.5 m/s², and then raises an alarm at once.
  </p>
);
