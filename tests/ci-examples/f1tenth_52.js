// f1tenth/f1tenth_gym#52: the fourth stage of RK4 takes the second's slope instead of the third's.
const m = 3.7, k = 2.9, h = 0.1;
const slope = ([q, v]) => [v, (-k / m) * q];
const add = (z, c, d) => [z[0] + c * d[0], z[1] + c * d[1]];
let z = [0.3, 0.19];
console.log("t,q,v");
for (let i = 0; i <= 200; i++) {
  console.log(`${i * h},${z}`);
  const k1 = slope(z), k2 = slope(add(z, h / 2, k1)), k3 = slope(add(z, h / 2, k2)), k4 = slope(add(z, h, k2));
  [k1, k2, k2, k3, k3, k4].forEach((x) => (z = add(z, h / 6, x)));
}
