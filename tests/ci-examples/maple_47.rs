// ClickFF/MAPLE#47: a restart takes velocities of half a step before for those of its own time.
fn main() {
    let (m, k, h) = (3.7_f64, 2.9_f64, 0.1_f64);
    let (mut q, mut v) = (0.3_f64, 0.19_f64);
    println!("t,q,v");
    for i in 0..=200 {
        if i == 100 {
            v += h / 2.0 * k / m * q;
        }
        println!("{:?},{:?},{:?}", i as f64 * h, q, v);
        v -= h / 2.0 * k / m * q;
        q += h * v;
        v -= h / 2.0 * k / m * q;
    }
}
