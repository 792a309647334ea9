// rebound goes on from the state that it interpolated for display: its springs run 3 % slow.  npm install rebound
const rebound = require("rebound");
const FRAME = 16.667; // ms, the default of its SimulationLooper
const K = 230.2, FRAMES = 600; // the default tension, its friction left out; ten seconds
const looper = new rebound.SteppingSimulationLooper();
const spring = new rebound.SpringSystem(looper).createSpringWithConfig({ tension: K, friction: 0 });
spring.setRestSpeedThreshold(0);
spring.setRestDisplacementThreshold(0);
spring.setEndValue(1);
let left = 0, lost = 0, angle = 0, phase = 0, seconds = 0;
for (let i = 0, time = 0; i < FRAMES; i++) {
  const before = i ? time : FRAME - 1; // the first frame lasts 1 ms
  looper.step(FRAME);
  time += FRAME;
  const now = Math.atan2(spring.getVelocity() / Math.sqrt(K), 1 - spring.getCurrentValue());
  phase += (now - angle + 4 * Math.PI) % (2 * Math.PI);
  angle = now;
  // the law: what is left of a frame is a part alpha of a step of 1 ms, and 1 - alpha of a step is taken back
  seconds += (time - before) / 1000;
  for (left += (time - before) / 1000; left >= 0.001; ) left -= 0.001;
  if (left > 0) lost += 0.001 - left;
}
const measured = phase / Math.sqrt(K) / seconds;
console.log(`measured ${measured} law ${1 - lost / seconds} uncertainty 1e-4 promised 1`);
