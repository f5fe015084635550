//! Every plant meets the same vehicle checks.

use brakecheck::sim::{Body, Command, Ground, PlantKind, Pose, plant};

const KINDS: [PlantKind; 2] = [PlantKind::Rigid, PlantKind::Kinematic];

#[test]
fn explore() {
    for kind in KINDS {
        let sedan = Body::shipped("sedan").unwrap().unwrap();
        let mut p = plant(kind, Ground { friction: 1.0 });
        let id = p.spawn(&sedan, Pose::default(), 0.0);
        p.command(
            id,
            Command::Drive {
                accel_mps2: 4.0,
                curvature_per_m: 0.0,
            },
        );
        let mut t = 0.0;
        while p.state(id).speed_mps < 100.0 / 3.6 && t < 20.0 {
            p.advance(0.05, 4);
            t += 0.05;
        }
        println!("{kind:?} 0-100 {t} {:?}", p.state(id));
        println!("{:?}", p.placement(id));
        for a in [-9.81, -3.0] {
            let mut q = plant(kind, Ground { friction: 1.0 });
            let id = q.spawn(&sedan, Pose::default(), 100.0 / 3.6);
            q.command(
                id,
                Command::Drive {
                    accel_mps2: a,
                    curvature_per_m: 0.0,
                },
            );
            for _ in 0..400 {
                q.advance(0.05, 4);
            }
            println!("brake {a} {:?} {:?}", q.state(id), q.placement(id).rotation);
        }
        for g in [0.3, 0.6, 0.9, 0.98, 1.2] {
            for v in [10.0, 20.0, 30.0] {
                let mut q = plant(kind, Ground { friction: 1.0 });
                let id = q.spawn(&sedan, Pose::default(), v);
                q.command(
                    id,
                    Command::Drive {
                        accel_mps2: 0.0,
                        curvature_per_m: g * 9.81 / (v * v),
                    },
                );
                for _ in 0..100 {
                    q.advance(0.05, 4);
                }
                let s = q.state(id);
                println!(
                    "corner {g} {v}: {:.4} kappa ratio {:.4} {s:?}",
                    s.speed_mps * s.yaw_rate_rad_per_s / 9.81,
                    s.yaw_rate_rad_per_s / s.speed_mps / (g * 9.81 / (v * v))
                );
            }
        }
    }
}
