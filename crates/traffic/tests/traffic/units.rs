//! Values that contradict each other or cannot be: boxes, headings and rates.

use brakecheck_traffic::{ColumnMap, read_csv, read_csv_guessed};

use super::foreign::{State, generic, generic_line, rows, steady};

#[test]
fn boxes_and_reversing_are_read_as_they_can_be() {
    let back = |t: f64| State {
        x: -4.0 * t,
        y: 0.0,
        heading: 0.0,
        speed: -4.0,
    };
    // A vehicle that says it drives back heads away from its motion.
    let text = rows(&[("a", &back)], 10.0, 10.0, &generic_line);
    let recording = generic(&text).expect("rows");
    assert!(
        recording.tracks[0]
            .speed_mps
            .iter()
            .all(|it| (it + 4.0).abs() < 1e-9)
    );
    let ahead = steady(0.0, 0.0, 0.3, 20.0);
    let with_box = |length: &str, width: &str| {
        let line = |t: f64, id: &str, s: State| {
            let generic = generic_line(t, id, s);
            // The box of `generic_line`.
            generic.replace(",4.5,1.8", &format!(",{length},{width}"))
        };
        let read = generic(&rows(&[("a", &ahead)], 10.0, 5.0, &line));
        read.err().map(|it| it.to_string()).unwrap_or_default()
    };
    assert_eq!(with_box("4.5", "1.8"), "");
    assert_eq!(
        with_box("1.8", "4.5"),
        "`log.csv`: road users are 4.50 m wide and 1.80 m long"
    );
    // Centimetres: no road user is as wide.
    let said = with_box("450", "180");
    assert!(
        said.contains("column `width`: 180 is not the size"),
        "{said}"
    );
    // A comma beside points may separate thousands.
    let text = "time;id;x;y\n0,0;a;0,5;0\n0,1;a;2.5;0\n";
    let error = read_csv_guessed(text.as_bytes(), "log.csv").expect_err("both signs");
    assert!(
        error.to_string().contains("line 3, column `x`: `2.5`"),
        "{error}"
    );
}

#[test]
fn of_readings_of_headings_that_fit_the_nearest_is_named() {
    // By chance, degrees read as radians may be near the course or its opposite.
    for heading in [0.05, 0.3, 0.7, 1.2] {
        let car = steady(0.0, 0.0, heading, 20.0);
        // A compass counts from the north, clockwise.
        let north = std::f64::consts::FRAC_PI_2;
        let said = |turned: &dyn Fn(f64) -> f64| {
            let line = |t: f64, id: &str, s: State| {
                let heading = turned(s.heading);
                generic_line(t, id, State { heading, ..s })
            };
            let read = generic(&rows(&[("a", &car)], 10.0, 10.0, &line));
            read.err().map(|it| it.to_string()).unwrap_or_default()
        };
        let degrees = said(&f64::to_degrees);
        assert!(degrees.ends_with("fits degrees"), "{heading}: {degrees}");
        let compass = said(&|it| (north - it).to_degrees());
        assert!(
            compass.contains("degrees of a compass"),
            "{heading}: {compass}"
        );
    }
    // Twice the rate is no knots.
    let map = ColumnMap::shipped("highd").expect("shipped");
    let header = "frame,id,x,y,width,height,xVelocity,yVelocity,xAcceleration,yAcceleration\n";
    let car = steady(0.0, 0.0, 0.0, 20.0);
    let line = |t: f64, id: &str, s: State| {
        // The shipped map reads 25 frames per second.
        format!("{:.0},{id},{},0,4.5,1.8,{},0,0,0", 50.0 * t, s.x, s.speed)
    };
    let text = header.to_owned() + &rows(&[("a", &car)], 50.0, 10.0, &line);
    let error = read_csv(text.as_bytes(), "t.csv", &map).expect_err("50 Hz");
    assert!(error.to_string().contains("50.00 Hz"), "{error}");
}
