// ThomasLengeling/traerphysics#2: the force of the spring is multiplied by the step and divided by it.
const m = 3.7, k = 2.9, h = 0.1;
let q = 0.3, v = 0.19;
console.log("t,q,v");
for (let i = 0; i <= 200; i++) {
  console.log(`${i * h},${q},${v}`);
  v -= (h * k * q) / m;
  q += v / h;
}
