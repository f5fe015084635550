//! Numbers and lists of a file that would take minutes are refused by line.

use super::hostile::LIGHT;
use super::*;
use brakecheck::openx::import::driven_lanes;

/// A controller of the light on the ego's way, with some phases.
fn controlled(phases: impl IntoIterator<Item = String>) -> [Edit; 2] {
    let phases: String = phases.into_iter().collect();
    let controller = format!(
        r#"<TrafficSignals><TrafficSignalController name="lights">{phases}</TrafficSignalController></TrafficSignals>"#
    );
    [
        edit("<!--network-->", controller),
        edit("<!--signals-->", format!("<signals>{LIGHT}</signals>")),
    ]
}

fn phase(duration_s: f64, states: &str) -> String {
    format!(r#"<Phase name="p" duration="{duration_s}">{states}</Phase>"#)
}

fn state(colour: &str) -> String {
    format!(r#"<TrafficSignalState trafficSignalId="7" state="{colour}"/>"#)
}

#[test]
fn controllers_heights_banks_and_widths_are_few() {
    let chain = (0..300).map(|i| {
        let next = (i + 1) % 300;
        format!(r#"<TrafficSignalController name="c{i}" reference="c{next}" delay="1"/>"#)
    });
    let chain: String = chain.collect();
    let chain = format!("<TrafficSignals>{chain}</TrafficSignals>");
    let colours = ["red", "green"].into_iter().cycle().take(1_000);
    let flood = controlled(colours.map(|colour| phase(0.001, &state(colour))));
    let states = controlled([phase(5.0, &state("red").repeat(60_000))]);
    let inside = |list: &str, element: &str| {
        let many = element.repeat(25_000);
        edit(format!("<{list}/>"), format!("<{list}>{many}</{list}>"))
    };
    let lane = |id: i32| {
        let widths = WIDTH.repeat(4_000);
        format!(r#"<lane id="{id}" type="driving">{widths}</lane>"#)
    };
    let lanes: String = (2..9).map(lane).collect();
    table! {
        "controllers that refer to each other":
            [edit("<!--network-->", chain)] => says("more than 200");
        "lights that change too often": [flood.clone()] => says("change too often");
        "and are named by their controller": [flood] => says("TrafficSignalController `lights`");
        "states without end": [states] => says("states of signals");
        "heights without end":
            [inside("elevationProfile", r#"<elevation s="0" a="0" b="0" c="0" d="0"/>"#)]
            => says("at most 20000 are read");
        "banks without end":
            [inside("lateralProfile", r#"<superelevation s="0" a="0" b="0" c="0" d="0"/>"#)]
            => says("at most 20000 are read");
        "widths without end": [edit("<left>", format!("<left>{lanes}"))] => says("at most 20000 are read");
    }
}

#[test]
fn a_world_that_refuses_a_light_points_at_its_controller() {
    let phases = ["red", "green"].map(|colour| phase(5.0, &state(colour)));
    let imported = imported(&controlled(phases));
    let world = &imported.worlds[0];
    let light = world.text.find("Light(").expect("a light");
    let error = world.refused(light + 10, "too long").expect("a place");
    let (name, line) = *error.element.expect("an element");
    assert_eq!(name, "TrafficSignalController `lights`");
    assert!(line > 1);
    // Later parts do not come from the controller.
    let spec = world.text.find("ego_spec").expect("a specification");
    let error = world.refused(spec, "never").expect("a place");
    assert!(!error.to_string().contains("lights"), "{error}");
}

#[test]
fn a_large_scenario_is_read_at_fewer_points() {
    let properties = r#"<Property name="a" value="1"/>"#.repeat(3_000);
    let mut files = files(&[
        edit(
            "<ParameterDeclarations/>",
            r#"<ParameterDeclarations><ParameterDeclaration name="q" parameterType="double" value="1"/></ParameterDeclarations>"#,
        ),
        edit(
            "<!--entities-->",
            format!("<!--entities--><a>{properties}</a>"),
        ),
    ]);
    files.push((
        "points.xosc",
        r#"<OpenSCENARIO><ParameterValueDistribution><ScenarioFile filepath="base.xosc"/><Deterministic><DeterministicSingleParameterDistribution parameterName="q"><DistributionRange stepWidth="1"><Range lowerLimit="0" upperLimit="9000"/></DistributionRange></DeterministicSingleParameterDistribution></Deterministic></ParameterValueDistribution></OpenSCENARIO>"#.to_owned(),
    ));
    let read = |only: Option<usize>| {
        let import = Import {
            only,
            ..at_points()
        };
        import_as(&import, &files)
    };
    let error = read(None).expect_err("too much to read");
    let says = ["points of a scenario of this size", "points.xosc"];
    assert_names(&error, 1, &says);
    // Any single one of them is read.
    assert!(read(Some(8_999)).is_ok());
}

#[test]
fn places_on_the_lanes_of_all_roads_are_bounded_together() {
    let road = |id: usize| {
        format!(
            "<road length=\"90000\" id=\"{id}\" junction=\"-1\"><planView><geometry s=\"0\" x=\"0\" y=\"0\" hdg=\"0\" length=\"90000\"><line/></geometry></planView><lanes><laneSection s=\"0\"><center><lane id=\"0\" type=\"none\"/></center><right><lane id=\"-1\" type=\"driving\">{WIDTH}</lane></right></laneSection></lanes></road>\n"
        )
    };
    let roads: String = (0..60).map(road).collect();
    let files = [("many.xodr", format!("<OpenDRIVE>\n{roads}</OpenDRIVE>"))];
    let error = driven_lanes(Path::new("many.xodr"), &|path| text_of(&files, path));
    let error = error.expect_err("too many");
    assert_names(&error, 1, &["more than 2000000 places"]);
}
