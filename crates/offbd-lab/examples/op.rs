use nalgebra::Vector2;
use offbd_core::plant::{Ball, Contact, Motion, Plate};
use offbd_lab::scene::*;
use offbd_lab::timing::cpu_time;
use std::f64::consts::PI;
fn scene(name: &str) -> (Scene, Laws) {
    let (law, contact) = match name.strip_suffix("-soft") {
        Some(l) => (l, Contact::SOFT),
        None => (name, Contact::CHAPTER),
    };
    let sine = |frequency, phase| Term::Sine { amplitude: 0.05, frequency, phase };
    let (qx, qy, d) = match law {
        "slope" => (vec![Term::Constant(PI / 20.0)], vec![Term::Constant(PI / 20.0)], 0.4),
        "sine" => (vec![sine(0.7, 0.0)], vec![sine(0.9, 0.5)], 10.0),
        _ => (
            vec![Term::Constant(0.0)],
            vec![Term::Smoothstep { to: 1.2, start: 0.1, duration: 0.15 }],
            0.5,
        ),
    };
    (
        Scene::new(Subject::Ball(Ball::default()), Plate::default(), contact, d).unwrap(),
        Laws::new(Law::new(&qx), Law::new(&qy), vec![]),
    )
}
struct Dice(u64);
impl Dice {
    fn roll(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }
    fn between(&mut self, a: f64, b: f64) -> f64 {
        a + (b - a) * self.roll()
    }
    fn term(&mut self) -> Term {
        match (3.0 * self.roll()) as u32 {
            0 => Term::Constant(self.between(-0.3, 0.3)),
            1 => Term::Sine {
                amplitude: self.between(0.0, 0.4),
                frequency: self.between(0.1, 3.0),
                phase: self.between(0.0, 6.0),
            },
            _ => Term::Smoothstep {
                to: self.between(-1.4, 1.4),
                start: self.between(0.0, 0.5),
                duration: self.between(0.1, 0.6),
            },
        }
    }
    fn law(&mut self) -> Vec<Term> {
        (0..(3.0 * self.roll()) as u32).map(|_| self.term()).collect()
    }
    fn scene(&mut self) -> (Scene, Laws) {
        let (k, d) = if self.roll() < 0.5 { (1000.0, 100.0) } else { (800_000.0, 1000.0) };
        let c = Contact::new(k, d, self.between(0.05, 1.0), 1e-4).unwrap();
        let t = [self.law(), self.law()];
        (
            Scene::new(Subject::Ball(Ball::default()), Plate::default(), c, 1.0).unwrap(),
            Laws::new(Law::new(&t[0]), Law::new(&t[1]), vec![]),
        )
    }
}
const N: f64 = 1777.0;
fn truth(s: &Scene, l: &Laws) -> Vec<Vector2<f64>> {
    let mut v = vec![];
    let mut sink = |_: f64, m: &Motion| v.push(m.position.xy());
    let mut smp = Samples::new(s.duration_s / N, &mut sink);
    run(
        s,
        &mut l.clone(),
        &Configuration::new(Model::Compliant, Method::Rodas4, Pace::Tolerance(1e-10)).unwrap(),
        Some(&mut smp),
    )
    .unwrap();
    v
}
fn off(s: &Scene, l: &Laws, t: f64, truth: &[Vector2<f64>]) -> Result<(f64, OnePass), Declined> {
    let mut v = vec![];
    let mut sink = |_: f64, m: &Motion| v.push(m.position.xy());
    let mut smp = Samples::new(s.duration_s / N, &mut sink);
    let o = one_pass(s, &mut l.clone(), t, Some(&mut smp))?;
    if std::env::var("TRACE").is_ok() {
        for i in (0..v.len()).step_by(40) {
            println!(
                "   {:.4} {:.3e} {:?}",
                i as f64 * s.duration_s / N,
                (v[i] - truth[i]).norm(),
                truth[i].as_slice()
            );
        }
    }
    assert_eq!(v.len(), truth.len(), "{o:?}");
    Ok((v.iter().zip(truth).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max), o))
}
fn q(v: &mut Vec<f64>, f: f64) -> f64 {
    if v.is_empty() {
        return f64::NAN;
    }
    v.sort_by(f64::total_cmp);
    v[((v.len() - 1) as f64 * f) as usize]
}
fn main() {
    let ab: Vec<String> = std::env::args().collect();
    if ab.get(1).is_some_and(|a| a == "random") {
        let n: usize = ab[2].parse().unwrap();
        let mut d = Dice(ab[3].parse().unwrap());
        let (mut over, mut declined, mut kinds) =
            (0, 0, std::collections::BTreeMap::<String, (usize, f64, Vec<f64>)>::new());
        let mut all = vec![];
        for i in 0..n {
            let (s, l) = d.scene();
            if ab.len() > 4 && !ab[4..].contains(&i.to_string()) {
                continue;
            }
            let tr = truth(&s, &l);
            for t in [1e-2, 1e-3, 1e-4, 1e-5, 1e-6] {
                match off(&s, &l, t, &tr) {
                    Err(e) => {
                        declined += 1;
                        println!("declined {i} {t:e}: {e}");
                    }
                    Ok((e, o)) => {
                        let last = o.stages.last().unwrap();
                        let kind = format!(
                            "{}{}",
                            last.model,
                            if o.stages.len() > 1 && last.model == "compliant" { "+" } else { "" }
                        );
                        if e > t || e > o.error_m.max(t) {
                            over += 1;
                            println!(
                                "OVER {i} {t:e}: {:.2} bound {:.2} {kind} k {} mu {:.2} why {:?}",
                                e / t,
                                o.error_m / t,
                                s.contact.stiffness_n_per_m(),
                                s.contact.friction(),
                                o.stages
                                    .iter()
                                    .map(|s| (s.from_s, s.model, s.why))
                                    .collect::<Vec<_>>()
                            );
                            if ab.len() > 4 {
                                println!("  {l:?}")
                            }
                        }
                        let c = cpu_time(1, || {
                            let _ = std::hint::black_box(one_pass(&s, &mut l.clone(), t, None));
                        })
                        .minimum_s
                            * 1e6;
                        let k = kinds.entry(kind).or_default();
                        k.0 += 1;
                        k.1 += c;
                        k.2.push(e / t);
                        all.push(e / t);
                    }
                }
            }
        }
        println!(
            "{} runs, over {over}, declined {declined}; error/T median {:.3} 90% {:.3} 99% {:.3} max {:.3}",
            all.len(),
            q(&mut all, 0.5),
            q(&mut all, 0.9),
            q(&mut all, 0.99),
            q(&mut all, 1.0)
        );
        for (k, (n, c, mut v)) in kinds {
            println!(
                "{k:12} {n:6} sum {:10.1} us mean {:8.2}  error/T median {:.3} 99% {:.3} max {:.3}",
                c,
                c / n as f64,
                q(&mut v, 0.5),
                q(&mut v, 0.99),
                q(&mut v, 1.0)
            );
        }
        return;
    }
    let cheap: [[f64; 5]; 6] = [
        [0.20, 0.81, 0.81, 0.81, 0.81],
        [2.31, 2.31, 2.31, 2.37, 5.68],
        [4.36, 7.91, 38.1, 151., 570.],
        [0.2, 0.8, 0.8, 0.8, 0.8],
        [2.31, 2.76, 11.5, 23.9, 65.8],
        [4.5, 4.5, 154., 169., 304.],
    ];
    let mut ratios = vec![];
    for (j, name) in
        ["slope", "sine", "steep", "slope-soft", "sine-soft", "steep-soft"].into_iter().enumerate()
    {
        let (s, l) = scene(name);
        let tr = truth(&s, &l);
        for (i, t) in [1e-2, 1e-3, 1e-4, 1e-5, 1e-6].into_iter().enumerate() {
            let (e, o) = match off(&s, &l, t, &tr) {
                Ok(x) => x,
                Err(e) => {
                    println!("{name} {t:e}: {e}");
                    continue;
                }
            };
            let mut ll = l.clone();
            let c = cpu_time(7, || {
                let _ = std::hint::black_box(one_pass(std::hint::black_box(&s), &mut ll, t, None));
            })
            .minimum_s
                * 1e6
                / s.duration_s;
            ratios.push(c / cheap[j][i]);
            println!(
                "{name:11} {t:e}: {c:8.3} us/s  / cheapest {:7.2}  error/T {:.3} bound/T {:.3} steps {} rejected {} {:?}",
                c / cheap[j][i],
                e / t,
                o.error_m / t,
                o.statistics.steps,
                o.statistics.rejected,
                o.stages.iter().map(|s| format!("{} {:.3}", s.model, s.from_s)).collect::<Vec<_>>()
            );
        }
    }
    println!("median {:.2} max {:.2}", q(&mut ratios.clone(), 0.5), q(&mut ratios, 1.0));
}
