//! Synthetic traffic on a curved road of two carriageways with two lanes each.

use std::fmt::Write;

/// Radius of the road's middle.
const RADIUS_M: f64 = 2500.0;
/// Length of the observed section.
pub const SECTION_M: f64 = 1500.0;
/// Period of the simulation.
pub const DT_S: f64 = 0.05;
/// Length of a lane change.
const CHANGE_S: f64 = 4.0;
/// Offsets of the lanes from the middle of the road, on the right of the way.
pub const LANES_M: [f64; 2] = [-11.25, -7.5];

/// Small deterministic generator of numbers in [0, 1).
#[derive(Clone, Copy)]
pub struct Draws(pub u64);

impl Draws {
    pub fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 33) as f64) / f64::from(1_u32 << 31)
    }

    /// Sum of twelve draws: mean 0, standard deviation 1.
    pub fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.next()).sum::<f64>() - 6.0
    }
}

/// Vehicle of the simulation.
#[derive(Clone, Debug)]
pub struct Car {
    pub direction: usize,
    pub lane: usize,
    pub length_m: f64,
    /// Front bumper along the middle of the road, in the direction of travel.
    pub front_m: f64,
    pub speed_mps: f64,
    pub accel_mps2: f64,
    pub desired_mps: f64,
    pub time_gap_s: f64,
    /// Start of a change from the left lane to the right one.
    pub change_s: Option<f64>,
    pub noise_mps2: f64,
}

/// State of a vehicle at an instant.
#[derive(Clone, Debug)]
pub struct Row {
    pub sample: usize,
    pub id: usize,
    pub direction: usize,
    pub front_m: f64,
    /// To the left of the right lane.
    pub lateral_m: f64,
    pub length_m: f64,
    pub speed_mps: f64,
    pub accel_mps2: f64,
    /// Centre of the box and heading in the world.
    pub x_m: f64,
    pub y_m: f64,
    pub heading_rad: f64,
}

/// Simulates traffic. Returns rows by instant, and the number of cut-ins.
pub fn traffic(seed: u64, cars: usize, seconds: f64) -> (Vec<Row>, usize) {
    let mut draws = Draws(seed);
    let mut all: Vec<Car> = Vec::new();
    for direction in 0..2 {
        for lane in 0..2 {
            for i in 0..cars {
                all.push(Car {
                    direction,
                    lane,
                    length_m: if draws.next() < 0.2 { 12.0 } else { 4.5 },
                    front_m: -(i as f64) * (70.0 + 30.0 * draws.next()) + 900.0,
                    speed_mps: 26.0 + 4.0 * lane as f64,
                    accel_mps2: 0.0,
                    desired_mps: 26.0 + 4.0 * lane as f64 + 3.0 * draws.next(),
                    time_gap_s: 0.9 + 0.8 * draws.next(),
                    change_s: None,
                    noise_mps2: 0.0,
                });
            }
        }
    }
    let (mut rows, mut cut_ins) = (Vec::new(), 0);
    for sample in 0..(seconds / DT_S) as usize {
        let time_s = sample as f64 * DT_S;
        if sample % 40 == 0 {
            cut_ins += usize::from(change_lane(&mut all, time_s));
        }
        step(&mut all, &mut draws);
        for (id, car) in all.iter().enumerate() {
            if (0.0..SECTION_M).contains(&(car.front_m - car.length_m)) {
                rows.push(row(sample, id, car, time_s));
            }
        }
    }
    (rows, cut_ins)
}

/// Vehicle ahead of `own` in its lane.
fn lead<'a>(all: &'a [Car], own: &Car) -> Option<&'a Car> {
    let ahead = |it: &&Car| {
        it.direction == own.direction && it.lane == own.lane && own.front_m < it.front_m
    };
    let ahead = all.iter().filter(ahead);
    ahead.min_by(|a, b| a.front_m.total_cmp(&b.front_m))
}

fn step(all: &mut [Car], draws: &mut Draws) {
    let before = all.to_vec();
    for (car, old) in all.iter_mut().zip(&before) {
        let free = 1.0 - (old.speed_mps / old.desired_mps).powi(4);
        let follow = lead(&before, old).map_or(0.0, |lead| {
            let gap_m = (lead.front_m - lead.length_m - old.front_m).max(0.5);
            let closing = old.speed_mps - lead.speed_mps;
            let wanted = 2.0 + old.speed_mps * old.time_gap_s + 0.35 * old.speed_mps * closing;
            (wanted.max(2.0) / gap_m).powi(2)
        });
        // Slow noise, now and then a braking.
        car.noise_mps2 = 0.98 * old.noise_mps2 + 0.05 * draws.normal();
        if draws.next() < 1.0e-4 {
            car.noise_mps2 -= 2.0 + 2.0 * draws.next();
        }
        car.accel_mps2 = (1.2 * (free - follow) + car.noise_mps2).clamp(-8.0, 2.0);
        car.speed_mps = (old.speed_mps + car.accel_mps2 * DT_S).max(0.0);
        car.front_m += 0.5 * (old.speed_mps + car.speed_mps) * DT_S;
    }
}

/// Lets one vehicle change to the right lane, in front of a follower within 60 m.
fn change_lane(all: &mut [Car], time_s: f64) -> bool {
    let fits = |car: &Car| {
        if car.lane != 1 || car.change_s.is_some() || !(200.0..900.0).contains(&car.front_m) {
            return false;
        }
        let others = all
            .iter()
            .filter(|it| it.lane == 0 && it.direction == car.direction);
        let mut behind = false;
        for it in others {
            let ahead_m = it.front_m - car.front_m;
            if (-car.length_m - 10.0..it.length_m + 10.0).contains(&ahead_m) {
                return false;
            }
            behind |= (-60.0..0.0).contains(&ahead_m) && it.front_m > 100.0;
        }
        behind
    };
    let Some(i) = all.iter().position(fits) else {
        return false;
    };
    all[i].lane = 0;
    all[i].change_s = Some(time_s);
    true
}

fn row(sample: usize, id: usize, car: &Car, time_s: f64) -> Row {
    let width_m = LANES_M[1] - LANES_M[0];
    let lateral_m = match car.change_s {
        Some(start_s) => {
            let share = ((time_s - start_s) / CHANGE_S).min(1.0);
            0.5 * width_m * (1.0 + (std::f64::consts::PI * share).cos())
        }
        None => width_m * car.lane as f64,
    };
    // The direction of travel is counter-clockwise with the lanes on its right.
    let centre_m = car.front_m - 0.5 * car.length_m;
    let turn = if car.direction == 0 { 1.0 } else { -1.0 };
    let along_m = if car.direction == 0 {
        centre_m
    } else {
        SECTION_M - centre_m
    };
    let radius_m = RADIUS_M - turn * (LANES_M[0] + lateral_m);
    let angle = along_m / RADIUS_M;
    Row {
        sample,
        id,
        direction: car.direction,
        front_m: car.front_m,
        lateral_m,
        length_m: car.length_m,
        speed_mps: car.speed_mps * radius_m / RADIUS_M,
        accel_mps2: car.accel_mps2,
        x_m: radius_m * angle.sin(),
        y_m: RADIUS_M - radius_m * angle.cos(),
        heading_rad: if car.direction == 0 {
            angle
        } else {
            angle - std::f64::consts::PI
        },
    }
}

/// Writes rows as the DLR format does, in UTM coordinates and degrees.
///
/// Speeds are `speed_factor` times the true ones, as recorders have it.
pub fn dlr(rows: &[Row], speed_factor: f64) -> String {
    let mut text = String::from(
        "timestamp,id,center_easting,center_northing,velocity_easting,velocity_northing,\
         velocity_magnitude,acceleration_easting,acceleration_northing,acceleration_magnitude,\
         acceleration_signed,yaw,dimension_length,dimension_width,dimension_height,\
         classifications_pedestrian,classifications_bicycle,classifications_motorbike,\
         classifications_car,classifications_van,classifications_truck,interpolated\n",
    );
    for row in rows {
        let (sin, cos) = row.heading_rad.sin_cos();
        let speed = speed_factor * row.speed_mps;
        let micros = 4659 + row.sample as u64 * 50_000;
        let seconds = micros / 1_000_000;
        let is_truck = f64::from(u8::from(row.length_m > 8.0));
        let _ = writeln!(
            text,
            "2024-10-07 {:02}:{:02}:{:02}.{:06}+00:00,{},{:.3},{:.3},{:.3},{:.3},{:.3},{:.3},\
             {:.3},{:.3},{:.3},{:.3},{:.3},2.0,1.6,0.0,0.0,0.0,{:.1},0.0,{is_truck:.1},False",
            6 + seconds / 3600,
            seconds / 60 % 60,
            seconds % 60,
            micros % 1_000_000,
            1_728_280_701_000_000 + row.id,
            614_000.0 + row.x_m,
            5_793_000.0 + row.y_m,
            speed * cos,
            speed * sin,
            speed,
            row.accel_mps2 * cos,
            row.accel_mps2 * sin,
            row.accel_mps2.abs(),
            row.accel_mps2,
            row.heading_rad.to_degrees(),
            row.length_m,
            1.0 - is_truck,
        );
    }
    text
}
