//! Numbers and lists of a file that would take minutes are refused by line.

use super::*;
use brakecheck::openx::import::driven_lanes;

const WIDTH: &str = r#"<width sOffset="0" a="3.5" b="0" c="0" d="0"/>"#;
const SIGNALS: &str =
    r#"<signals><signal id="7" s="300" t="-2" dynamic="yes" orientation="+" name="x"/></signals>"#;

/// A controller of the light on the ego's way, with some phases.
fn controlled(phases: impl IntoIterator<Item = String>) -> [Edit; 2] {
    let phases: String = phases.into_iter().collect();
    let controller = format!(
        r#"<TrafficSignals><TrafficSignalController name="lights">{phases}</TrafficSignalController></TrafficSignals>"#
    );
    [
        edit("<!--network-->", controller),
        edit("<!--signals-->", SIGNALS),
    ]
}

fn phase(duration_s: f64, states: &str) -> String {
    format!(r#"<Phase name="p" duration="{duration_s}">{states}</Phase>"#)
}

fn state(colour: &str) -> String {
    format!(r#"<TrafficSignalState trafficSignalId="7" state="{colour}"/>"#)
}

#[test]
fn controllers_that_refer_to_each_other_are_few() {
    let chain = (0..300).map(|i| {
        let next = (i + 1) % 300;
        format!(r#"<TrafficSignalController name="c{i}" reference="c{next}" delay="1"/>"#)
    });
    let chain: String = chain.collect();
    let all = format!("<TrafficSignals>{chain}</TrafficSignals>");
    assert_says(&refused(&[edit("<!--network-->", all)]), "more than 200");
}

#[test]
fn lights_that_change_too_often_are_refused_at_their_controller() {
    let colours = ["red", "green"].into_iter().cycle().take(1_000);
    let flood = colours.map(|colour| phase(0.001, &state(colour)));
    let error = refused(&controlled(flood));
    assert_says(&error, "change too often");
    assert!(
        error
            .to_string()
            .contains("TrafficSignalController `lights`"),
        "{error}"
    );
    let states = phase(5.0, &state("red").repeat(60_000));
    assert_says(&refused(&controlled([states])), "states of signals");
}

#[test]
fn a_world_that_refuses_a_light_points_at_its_controller() {
    let phases = ["red", "green"].map(|colour| phase(5.0, &state(colour)));
    let imported = import(&files(&controlled(phases))).expect("a light");
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
fn heights_banks_and_widths_are_few() {
    let many = |element: &str| element.repeat(25_000);
    let height = many(r#"<elevation s="0" a="0" b="0" c="0" d="0"/>"#);
    let bank = many(r#"<superelevation s="0" a="0" b="0" c="0" d="0"/>"#);
    let lane = |id: i32| {
        let widths = WIDTH.repeat(4_000);
        format!(r#"<lane id="{id}" type="driving">{widths}</lane>"#)
    };
    let lanes: String = (2..9).map(lane).collect();
    let cases = [
        edit(
            "<elevationProfile/>",
            format!("<elevationProfile>{height}</elevationProfile>"),
        ),
        edit(
            "<lateralProfile/>",
            format!("<lateralProfile>{bank}</lateralProfile>"),
        ),
        edit("<left>", format!("<left>{lanes}")),
    ];
    for case in cases {
        assert_says(&refused(&[case]), "at most 20000 are read");
    }
}

#[test]
fn an_event_that_is_never_or_partly_carried_out_is_refused() {
    for count in ["0", "-1", "1.5"] {
        let edits = [edit(
            r#"priority="override" maximumExecutionCount="1""#,
            format!(r#"priority="override" maximumExecutionCount="{count}""#),
        )];
        assert_says(&refused(&edits), &format!("carried out {count} times"));
    }
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
            scenario: Path::new("base.xosc"),
            points: Some(Path::new("points.xosc")),
            only,
            skips_broken: false,
            name: "small",
            ado: None,
            ego: None,
            leaves_ego: false,
            maps: &[],
        };
        import.read(&|path| text_of(&files, path))
    };
    let error = read(None).expect_err("too much to read");
    assert_says(&error, "points of a scenario of this size");
    assert!(error.to_string().contains("points.xosc"), "{error}");
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
    assert_says(&error.expect_err("too many"), "more than 2000000 places");
}

fn text_of(files: &[(&'static str, String)], path: &Path) -> std::io::Result<String> {
    let found = files.iter().find(|(name, _)| Path::new(name) == path);
    let text = found.map(|(_, text)| text.clone());
    text.ok_or_else(|| std::io::Error::from(std::io::ErrorKind::NotFound))
}
