//! Faults that are planted into sound scenarios, and content that no world has.

use super::*;

#[test]
fn the_ego_is_a_planning_problem_of_the_file() {
    let two = scenario("2020a", &[&network(), &problem(1, GOAL), &problem(2, GOAL)]);
    let refused = refusal(&two);
    assert!(refused.contains("it has 2 planning problems"), "{refused}");
    let read = read_as(&two, Some("2"), None).unwrap_or_else(|it| panic!("{it}"));
    assert_eq!(read.dropped[0].kind, "further planning problems");
    assert!(
        read.text.contains("planning problem 2 of ZAM_Test-1_1_T-1"),
        "{}",
        read.text
    );
    let error = read_as(&two, Some("3"), None).expect_err("no problem 3");
    assert!(
        error.to_string().contains("no planning problem `3`"),
        "{error}"
    );
    assert_eq!(error.help.as_deref(), Some("name one of 1, 2"));
}

#[test]
fn all_that_cannot_be_right_is_refused_at_once_with_lines() {
    let text = sound()
        .replacen("<y>1.75</y>", "<y>far</y>", 1)
        .replacen("<time><exact>7</exact>", "<time><exact>9</exact>", 1)
        .replacen(
            "<velocity><exact>15</exact></velocity>",
            "<velocity><exact>-15</exact></velocity>",
            1,
        );
    let error = read_as(&text, None, None).expect_err("three problems");
    let lines: Vec<String> = error.all().map(ImportError::headline).collect();
    let expected = [
        (line_of(&text, "far"), "`far` is not a finite number"),
        (
            line_of(&text, "<time><exact>9") - 3,
            "time step 9 follows 6",
        ),
        (
            line_of(&text, "<planningProblem") + 1,
            "the ego starts with -15 m/s",
        ),
    ];
    assert_eq!(lines.len(), 3, "{error}");
    for (line, (at, what)) in lines.iter().zip(expected) {
        assert!(
            line.starts_with(&format!("`{FILE}`, line {at}, ")),
            "{line}: {at}"
        );
        assert!(line.ends_with(what), "{line}");
    }
    assert!(error.unread_part().is_some());
}

/// Each fault is planted into a scenario that is read, so that each refusal can fail.
#[test]
fn each_planted_fault_is_refused_with_its_reason() {
    let faults = [
        (
            "commonRoadVersion=\"2020a\"",
            "commonRoadVersion=\"2017a\"",
            "version `2017a` is not read",
        ),
        (
            "timeStepSize=\"0.1\"",
            "timeStepSize=\"0\"",
            "`timeStepSize` is `0`",
        ),
        (
            "timeStepSize=\"0.1\"",
            "timeStepSize=\"0.2\"",
            "the recorded speeds are 2",
        ),
        ("<trajectory>", "<occupancy>", "this is no XML"),
        (
            "<length>4.0</length>",
            "<length>-4.0</length>",
            "-4 is not positive",
        ),
        (
            "<orientation><exact>0.0</exact>",
            "<orientation><intervalStart>0</intervalStart><intervalEnd>1</intervalEnd>",
            "it has no exact value",
        ),
        (
            "<position><point><x>61</x><y>0</y></point></position>",
            "<position><circle><radius>1</radius></circle></position>",
            "its position is a region",
        ),
        ("<x>61</x>", "<x>1e300</x>", "nowhere on Earth"),
        (
            "<time><exact>3</exact>",
            "<time><exact>2</exact>",
            "time step 2 follows 2",
        ),
        (
            "<time><exact>3</exact>",
            "<time><exact>3.5</exact>",
            "3.5 is no time step",
        ),
        (
            "<x>20</x><y>0.2</y>",
            "<x>20</x><y>60.2</y>",
            "on no lanelet for cars",
        ),
        (
            "<lanelet id=\"3\">",
            "<lanelet id=\"1\">",
            "a second lanelet with the id 1",
        ),
        (
            "<dynamicObstacle id=\"31\">",
            "<dynamicObstacle>",
            "it has no `id`",
        ),
        (
            "<intervalStart>20</intervalStart>",
            "<intervalStart>90</intervalStart>",
            "the interval from 90 to 50 is reversed",
        ),
        (
            "<time><intervalStart>20</intervalStart><intervalEnd>50</intervalEnd></time>",
            "",
            "it has no time",
        ),
        ("<rectangle>", "<box>", "this is no XML"),
    ];
    assert!(read_as(&sound(), None, None).is_ok());
    for (sound_part, fault, says) in faults {
        let text = sound();
        assert!(text.contains(sound_part), "{sound_part}");
        let refused = refusal(&text.replacen(sound_part, fault, 1));
        assert!(refused.contains(says), "{fault}: {refused}");
    }
    let turned = problem(1, GOAL).replacen("<exact>0.0</exact>", "<exact>3.1</exact>", 1);
    let refused = refusal(&scenario("2020a", &[&network(), &turned]));
    assert!(
        refused.contains("against the direction of lanelet 1"),
        "{refused}"
    );
    let none = refusal(&scenario("2020a", &[&network()]));
    assert!(none.contains("it has no planning problem"), "{none}");
    // A bomb of nested entities ends before it grows.
    let bomb = format!("<!DOCTYPE x [<!ENTITY a \"aaaa\">]>{}", sound());
    assert!(refusal(&bomb).contains("it declares entities"));
}

#[test]
fn obstacles_that_no_world_has_are_listed() {
    let late = car(40, 80.0, 3.5, 10.0);
    // Its steps begin at 10.
    let mut shifted = late;
    for step in (0..=50).rev() {
        let (from, to) = (
            format!("<exact>{step}</exact></time>"),
            format!("<exact>{}</exact></time>", step + 10),
        );
        shifted = shifted.replace(&from, &to);
    }
    let wall = "<staticObstacle id=\"50\"><type>roadBoundary</type><shape><rectangle><length>300</length>\
        <width>1</width></rectangle></shape><initialState><position><point><x>0</x><y>-9</y></point></position>\
        <orientation><exact>0</exact></orientation><time><exact>0</exact></time></initialState></staticObstacle>\n";
    let phantom = "<phantomObstacle id=\"60\"/>\n";
    let text = scenario(
        "2020a",
        &[
            &network(),
            &car(31, 60.0, 0.0, 10.0),
            &shifted,
            wall,
            phantom,
            &problem(1, GOAL),
        ],
    );
    let read = read_as(&text, None, None).unwrap_or_else(|it| panic!("{it}"));
    let mut kinds: Vec<(&str, usize)> = read.dropped.iter().map(|it| (it.kind, it.line)).collect();
    kinds.sort();
    assert_eq!(
        kinds,
        [
            (
                "obstacles larger or smaller than any body",
                line_of(&text, "id=\"50\"")
            ),
            (
                "obstacles that appear after the start",
                line_of(&text, "id=\"40\"")
            ),
            ("phantom obstacles", line_of(&text, "id=\"60\"")),
        ]
    );
    assert_eq!(world_of(&read).agents.len(), 2);
}

#[test]
fn an_obstacle_that_touches_a_nearer_one_is_left_out() {
    // The one behind drives into the first after 3 s, and the third is beside the second.
    let cars = [
        car(31, 60.0, 0.0, 5.0),
        car(32, 100.0, 0.0, 2.0),
        car(33, 100.0, 3.5, 2.0),
    ];
    let rear = car(34, 40.0, 0.0, 10.0);
    let text = scenario(
        "2020a",
        &[&network(), &cars.concat(), &rear, &problem(1, GOAL)],
    );
    let read = read_as(&text, None, None).unwrap_or_else(|it| panic!("{it}"));
    let kinds: Vec<(&str, usize)> = read.dropped.iter().map(|it| (it.kind, it.line)).collect();
    // Car 34 is the nearest to the ego, and hits car 31.
    assert_eq!(
        kinds,
        [(
            "obstacles that touch a nearer one",
            line_of(&text, "id=\"31\"")
        )]
    );
    let world = world_of(&read);
    let names: Vec<&str> = world.agents.iter().map(AgentFile::name).collect();
    assert_eq!(names, ["ego", "car_34", "car_32", "car_33"]);
}
