//! Imports of small scenarios: each variant moves as its file says, or is refused
//! where it says so.
//!
//! The places are those of the laws of OpenSCENARIO; esmini has them to one of its
//! steps of 0.01 s.

#[path = "imports/blockers.rs"]
mod blockers;
#[path = "imports/hostile.rs"]
mod hostile;
#[path = "imports/limits.rs"]
mod limits;
#[path = "imports/places.rs"]
mod places;
#[path = "imports/precedence.rs"]
mod precedence;

use std::path::{Path, PathBuf};

use brakecheck::openx::import::{DroppedElements, Import, ImportError, Imported};
use brakecheck::scene::Start;
use brakecheck::testbench::{Aftermath, Constant, Episode, play};
use brakecheck::world::Scenario;
use brakecheck_sim::sim::Body;

const BASE: &str = include_str!("imports/base.xosc");
const ROADS: [(&str, &str); 3] = [
    ("straight.xodr", include_str!("imports/straight.xodr")),
    ("bend.xodr", include_str!("imports/bend.xodr")),
    ("network.xodr", include_str!("imports/network.xodr")),
];
/// From the rear axle, which a file places, to the front.
const LEVER_M: f64 = 3.6;

/// When the first event begins, and the act around it.
const FIRST: &str = r#"<Condition name="first begins" delay="0" conditionEdge="none"><ByValueCondition><SimulationTimeCondition value="2" rule="greaterThan"/></ByValueCondition></Condition>"#;
const ACT: &str = r#"<Condition name="act begins" delay="0" conditionEdge="none"><ByValueCondition><SimulationTimeCondition value="0" rule="greaterOrEqual"/></ByValueCondition></Condition>"#;
/// What the first event does.
const SLOWER: &str = r#"<LongitudinalAction><SpeedAction>
                <SpeedActionDynamics dynamicsShape="linear" dynamicsDimension="rate" value="1"/>
                <SpeedActionTarget><AbsoluteTargetSpeed value="4"/></SpeedActionTarget>
              </SpeedAction></LongitudinalAction>"#;
const FASTER: &str = r#"<LongitudinalAction><SpeedAction><SpeedActionDynamics dynamicsShape="linear" dynamicsDimension="rate" value="2"/><SpeedActionTarget><AbsoluteTargetSpeed value="10"/></SpeedActionTarget></SpeedAction></LongitudinalAction>"#;
const CHANGE: &str = r#"<LateralAction><LaneChangeAction targetLaneOffset="0.5"><LaneChangeActionDynamics dynamicsShape="sinusoidal" dynamicsDimension="rate" value="1"/><LaneChangeTarget><AbsoluteTargetLane value="-1"/></LaneChangeTarget></LaneChangeAction></LateralAction>"#;
const CENTRE: &str = r#"<LateralAction><LaneOffsetAction continuous="false"><LaneOffsetActionDynamics dynamicsShape="sinusoidal" maxLateralAcc="1"/><LaneOffsetTarget><AbsoluteTargetLaneOffset value="0"/></LaneOffsetTarget></LaneOffsetAction></LateralAction>"#;
const MEETING: &str = r#"<SynchronizeAction masterEntityRef="Ego"><TargetPositionMaster><LanePosition roadId="0" laneId="-1" s="300"/></TargetPositionMaster><TargetPosition><LanePosition roadId="0" laneId="-2" s="200"/></TargetPosition><FinalSpeed><AbsoluteSpeed value="10"><TargetDistanceSteadyState distance="5"/></AbsoluteSpeed></FinalSpeed></SynchronizeAction>"#;

/// A change of the files: a text, and what stands in its place.
type Edit = (&'static str, String);

fn edit(from: &'static str, to: impl Into<String>) -> Edit {
    (from, to.into())
}

fn time(at_s: f64, edge: &str, delay_s: f64) -> String {
    format!(
        r#"<Condition name="c" delay="{delay_s}" conditionEdge="{edge}"><ByValueCondition><SimulationTimeCondition value="{at_s}" rule="greaterThan"/></ByValueCondition></Condition>"#
    )
}

/// A clear distance to the lead of some of the others.
fn distance(who: &[&str], rule: &str, edge: &str, needs: &str, value_m: f64) -> String {
    let who: String = who
        .iter()
        .map(|name| format!(r#"<EntityRef entityRef="{name}"/>"#))
        .collect();
    format!(
        r#"<Condition name="c" delay="0" conditionEdge="{edge}"><ByEntityCondition><TriggeringEntities triggeringEntitiesRule="{needs}">{who}</TriggeringEntities><EntityCondition><RelativeDistanceCondition entityRef="Lead" relativeDistanceType="longitudinal" freespace="true" value="{value_m}" rule="{rule}"/></EntityCondition></ByEntityCondition></Condition>"#
    )
}

/// Another condition of an entity.
fn watch(who: &str, condition: &str) -> String {
    format!(
        r#"<Condition name="c" delay="0" conditionEdge="none"><ByEntityCondition><TriggeringEntities triggeringEntitiesRule="any"><EntityRef entityRef="{who}"/></TriggeringEntities><EntityCondition>{condition}</EntityCondition></ByEntityCondition></Condition>"#
    )
}

fn lane_change(shape: &str, dimension: &str, value: f64) -> String {
    format!(
        r#"<LateralAction><LaneChangeAction><LaneChangeActionDynamics dynamicsShape="{shape}" dynamicsDimension="{dimension}" value="{value}"/><LaneChangeTarget><AbsoluteTargetLane value="-1"/></LaneChangeTarget></LaneChangeAction></LateralAction>"#
    )
}

/// A trajectory of the lead: times with places, and how its times count.
fn trajectory(timing: &str, attributes: &str, places: &[(f64, f64, f64)]) -> String {
    let vertices: String = places.iter().map(|(time_s, x_m, y_m)| {
        format!(
            r#"<Vertex time="{time_s}"><Position><WorldPosition x="{x_m}" y="{y_m}"/></Position></Vertex>"#
        )
    }).collect();
    format!(
        r#"<RoutingAction><FollowTrajectoryAction{attributes}><TrajectoryRef><Trajectory name="t" closed="false"><Shape><Polyline>{vertices}</Polyline></Shape></Trajectory></TrajectoryRef><TimeReference>{timing}</TimeReference><TrajectoryFollowingMode followingMode="position"/></FollowTrajectoryAction></RoutingAction>"#
    )
}

/// A trajectory with a corner, of which the times are those of a kind.
fn timed(domain: &str, scale: f64, offset_s: f64, attributes: &str) -> String {
    trajectory(
        &format!(
            r#"<Timing domainAbsoluteRelative="{domain}" scale="{scale}" offset="{offset_s}"/>"#
        ),
        attributes,
        &[
            (0.0, 150.0, -5.25),
            (3.0, 180.0, -5.25),
            (5.0, 200.0, 4.75),
            (9.0, 220.0, 4.75),
        ],
    )
}

/// A profile of speeds, in durations and speeds.
fn profile(entries: &[(f64, f64)]) -> String {
    let entries: String = entries
        .iter()
        .map(|(lasts_s, speed_mps)| {
            format!(r#"<SpeedProfileEntry time="{lasts_s}" speed="{speed_mps}"/>"#)
        })
        .collect();
    format!(
        r#"<LongitudinalAction><SpeedProfileAction followingMode="position"><DynamicConstraints maxAcceleration="5" maxDeceleration="5"/>{entries}</SpeedProfileAction></LongitudinalAction>"#
    )
}

/// The event that follows the first, beside it.
fn beside(condition: &str, action: &str) -> Edit {
    let (from, text) = second(condition, action);
    (
        from,
        text.replace(r#"priority="override""#, r#"priority="parallel""#),
    )
}

fn slower_by(dynamics: &str) -> Vec<Edit> {
    let linear = r#"dynamicsShape="linear" dynamicsDimension="rate" value="1""#;
    vec![edit(SLOWER, SLOWER.replace(linear, dynamics))]
}

fn after(kind: &str, name: &str, delay_s: f64) -> String {
    format!(
        r#"<Condition name="c" delay="{delay_s}" conditionEdge="none"><ByValueCondition><StoryboardElementStateCondition storyboardElementType="{kind}" storyboardElementRef="{name}" state="endTransition"/></ByValueCondition></Condition>"#
    )
}

/// One more event of the lead.
fn second(condition: &str, action: &str) -> Edit {
    let text = format!(
        r#"<Event name="second" priority="override"><Action name="other"><PrivateAction>{action}</PrivateAction></Action><StartTrigger><ConditionGroup>{condition}</ConditionGroup></StartTrigger></Event>"#
    );
    edit("<!--events-->", text)
}

/// A story of its own that changes nothing but the friction.
fn rain(scale: &str) -> Edit {
    let text = format!(
        r#"</Actions></Init>
<Story name="weather"><Act name="rain"><ManeuverGroup name="rain" maximumExecutionCount="1"><Actors selectTriggeringEntities="false"/><Maneuver name="rain"><Event name="rain" priority="override"><Action name="rain"><GlobalAction>
<EnvironmentAction><Environment name="rain"><RoadCondition frictionScaleFactor="{scale}"/></Environment></EnvironmentAction>
</GlobalAction></Action><StartTrigger><ConditionGroup>{FIRST}</ConditionGroup></StartTrigger></Event></Maneuver></ManeuverGroup><StartTrigger><ConditionGroup>{ACT}</ConditionGroup></StartTrigger></Act></Story>"#
    );
    edit("</Actions></Init>", text)
}

/// A third car, on the ego's lane.
fn third() -> Vec<Edit> {
    let lead = |from: &str, to: &str| {
        let (_, rest) = BASE.split_once(from).expect("the beginning");
        let (text, _) = rest.split_once(to).expect("the end");
        format!("{from}{text}").replace("Lead", "Other")
    };
    let object = lead(r#"<ScenarioObject name="Lead">"#, "<!--entities-->");
    let placed = lead(r#"<Private entityRef="Lead">"#, "</Actions>")
        .replace(r#"laneId="-2" s="150""#, r#"laneId="-1" s="120""#)
        .replace(r#"value="10"/>"#, r#"value="15"/>"#);
    vec![
        edit("<!--entities-->", object),
        edit("</Actions></Init>", format!("{placed}</Actions></Init>")),
    ]
}

/// The files with changes, each of which must apply somewhere.
fn files(edits: &[Edit]) -> Vec<(&'static str, String)> {
    let mut all = vec![("base.xosc", BASE.to_owned())];
    all.extend(ROADS.map(|(name, text)| (name, text.to_owned())));
    for (from, to) in edits {
        let mut applied = false;
        for (_, text) in &mut all {
            applied |= text.contains(from);
            *text = text.replace(from, to);
        }
        assert!(applied, "{from}");
    }
    all
}

fn import(files: &[(&str, String)]) -> Result<Imported, ImportError> {
    import_as(files, (None, false), &[])
}

/// With an ego by name, whose motion may be left to the user, and maps by name.
fn import_as(
    files: &[(&str, String)],
    (ego, leaves_ego): (Option<&str>, bool),
    maps: &[(String, PathBuf)],
) -> Result<Imported, ImportError> {
    let import = Import {
        scenario: Path::new("base.xosc"),
        points: None,
        only: None,
        skips_broken: false,
        name: "small",
        ado: None,
        ego,
        leaves_ego,
        maps,
    };
    import.read(&|path| {
        let found = files.iter().find(|(name, _)| Path::new(name) == path);
        let text = found.map(|(_, text)| text.clone());
        text.ok_or_else(|| std::io::Error::from(std::io::ErrorKind::NotFound))
    })
}

fn world(imported: &Imported) -> Scenario {
    let text = &imported.worlds[0].text;
    Scenario::parse("small.ron", text).unwrap_or_else(|error| panic!("{error:?}\n{text}"))
}

fn run(world: &Scenario) -> Episode {
    let start = Start(Vec::new());
    let mut bench = world.bench();
    play(&mut bench, &start, 0, &mut Constant(0), Aftermath::Play)
}

/// The rear axle of somebody at a time.
fn at(episode: &Episode, name: &str, time_s: f64) -> (f64, f64) {
    at_by(episode, name, time_s, LEVER_M)
}

/// The point of somebody at a distance behind its front.
fn at_by(episode: &Episode, name: &str, time_s: f64, lever_m: f64) -> (f64, f64) {
    let row = (time_s / 0.05).round() as usize;
    let of = |what: &str| {
        let signal = episode.trace.signal(&format!("{name}.{what}"));
        *signal.expect("there").get(row).expect("a row so late")
    };
    let (x_m, y_m, heading_rad) = (of("x"), of("y"), of("heading"));
    (
        x_m - lever_m * heading_rad.cos(),
        y_m - lever_m * heading_rad.sin(),
    )
}

/// What differs from a place at a time by more than a step of esmini.
fn off(episode: &Episode, name: &str, (time_s, x_m, y_m): (f64, f64, f64)) -> Option<String> {
    let (x, y) = at(episode, name, time_s);
    let off_m = (x - x_m).hypot(y - y_m);
    (off_m > 0.02).then(|| format!("({x:.3}, {y:.3}), not ({x_m}, {y_m}), at {time_s} s"))
}

#[test]
fn small_scenarios_move_as_their_files_say() {
    // Lane -2, on which the lead starts, is the world's lane 0.
    let near = edit(r#"laneId="-1" s="50""#, r#"laneId="-1" s="140""#);
    let late_distance = |act_s: f64| {
        let below = distance(&["Ego"], "lessThan", "none", "any", 20.0);
        vec![edit(ACT, time(act_s, "none", 0.0)), edit(FIRST, below)]
    };
    let others = |needs: &str| {
        let mut edits = third();
        let below = distance(&["Ego", "Other"], "lessThan", "rising", needs, 20.0);
        edits.push(edit(FIRST, below));
        edits
    };
    let ego_at = |s_m: f64| edit(r#"laneId="-1" s="50""#, format!(r#"laneId="-1" s="{s_m}""#));
    let slow_ego = || {
        edit(
            r#"<AbsoluteTargetSpeed value="20"/><!--ego speed-->"#,
            r#"<AbsoluteTargetSpeed value="10"/>"#,
        )
    };
    let nearer = |value_m: f64| distance(&["Ego"], "lessThan", "rising", "any", value_m);
    let at_start = |action: String| vec![edit(FIRST, time(0.0, "none", 0.0)), edit(SLOWER, action)];
    let later = || edit(r#"laneId="-2" s="150""#, r#"laneId="-2" s="160""#);
    let offset = r#" initialDistanceOffset="10""#;
    let against = third()
        .into_iter()
        .map(|(from, text)| {
            let lane = r#"<LanePosition roadId="0" laneId="-1" s="120" offset="0"/>"#;
            let turned = r#"<LanePosition roadId="0" laneId="-2" s="900"><Orientation type="relative" h="3.141592653589793"/></LanePosition>"#;
            (from, text.replace(lane, turned))
        })
        .collect::<Vec<Edit>>();
    let relative = r#"<RelativeTargetLane entityRef="Other" value="-1"/>"#;
    let parameter = r#"<Condition name="c" delay="3" conditionEdge="none"><ByValueCondition><ParameterCondition parameterRef="on" rule="equalTo" value="1"/></ByValueCondition></Condition>"#;
    let declared = r#"<ParameterDeclarations><ParameterDeclaration name="on" parameterType="integer" value="1"/></ParameterDeclarations><CatalogLocations/>"#;
    type Case = (&'static str, Vec<Edit>, Vec<(f64, f64, f64)>);
    let cases: Vec<Case> = vec![
        (
            "as it is",
            vec![],
            vec![(2.0, 170.0, 0.0), (12.0, 228.0, 0.0)],
        ),
        (
            "an act within the first second begins when it says",
            vec![
                edit(ACT, time(0.6, "none", 0.0)),
                edit(FIRST, time(0.0, "none", 0.0)),
            ],
            vec![(12.0, 219.6, 0.0)],
        ),
        (
            "an event does not begin before its act",
            vec![edit(ACT, time(5.0, "none", 0.0))],
            vec![(12.0, 246.0, 0.0)],
        ),
        (
            "a rising edge of a time",
            vec![edit(FIRST, time(2.0, "rising", 0.0))],
            vec![(12.0, 228.0, 0.0)],
        ),
        (
            "either edge of a time that only rises",
            vec![edit(FIRST, time(2.0, "risingOrFalling", 0.0))],
            vec![(12.0, 228.0, 0.0)],
        ),
        (
            "a delay",
            vec![edit(FIRST, time(2.0, "rising", 1.5))],
            vec![(12.0, 237.0, 0.0)],
        ),
        (
            "the delay of what holds from the start on",
            vec![
                edit(FIRST, parameter),
                edit("<ParameterDeclarations/>\n  <CatalogLocations/>", declared),
            ],
            vec![(12.0, 234.0, 0.0)],
        ),
        (
            "any of two is near",
            others("any"),
            vec![(5.0, 192.4728, 0.0)],
        ),
        (
            "all of two are near",
            others("all"),
            vec![(5.0, 200.0, 0.0), (12.0, 260.1432, 0.0)],
        ),
        (
            "far apart behind an overtaking, too",
            vec![
                near.clone(),
                edit(
                    FIRST,
                    distance(&["Ego"], "greaterThan", "rising", "any", 30.0),
                ),
            ],
            vec![(12.0, 242.64, 0.0)],
        ),
        (
            "near after the act has begun",
            late_distance(3.0),
            vec![(12.0, 260.1432, 0.0)],
        ),
        (
            "near as the act begins",
            [late_distance(3.0), vec![near]].concat(),
            vec![(12.0, 234.0, 0.0)],
        ),
        (
            "one event after the other",
            vec![second(&after("event", "first", 1.0), FASTER)],
            vec![(9.0, 216.0, 0.0), (12.0, 237.0, 0.0)],
        ),
        (
            "a speed that is reached after the start, and changes again before",
            vec![edit(
                r#"<SpeedActionDynamics dynamicsShape="step" dynamicsDimension="time" value="0"/><!--init dynamics-->"#,
                r#"<SpeedActionDynamics dynamicsShape="linear" dynamicsDimension="rate" value="3"/>"#,
            )],
            vec![(2.0, 156.0, 0.0), (12.0, 198.0, 0.0)],
        ),
        (
            "a change of speed that replaces the one before it",
            vec![second(&time(4.0, "none", 0.0), FASTER)],
            vec![(4.0, 188.0, 0.0), (12.0, 267.0, 0.0)],
        ),
        (
            "a change of lane beside a change of speed that goes on",
            vec![
                edit(
                    r#"<AbsoluteTargetSpeed value="20"/><!--ego speed-->"#,
                    r#"<AbsoluteTargetSpeed value="10"/>"#,
                ),
                beside(&time(4.0, "none", 0.0), CHANGE),
            ],
            vec![(4.0, 188.0, 0.0), (7.0, 207.376, 1.859)],
        ),
        (
            "a change of speed beside a change of lane that goes on",
            vec![
                edit(
                    r#"<AbsoluteTargetSpeed value="20"/><!--ego speed-->"#,
                    r#"<AbsoluteTargetSpeed value="10"/>"#,
                ),
                edit(SLOWER, CHANGE),
                beside(&time(4.0, "none", 0.0), SLOWER),
            ],
            vec![(6.0, 207.870, 2.832), (9.0, 227.318, 4.0)],
        ),
        (
            "a cubic change of lane by time",
            vec![
                edit(
                    r#"<AbsoluteTargetSpeed value="20"/><!--ego speed-->"#,
                    r#"<AbsoluteTargetSpeed value="10"/>"#,
                ),
                edit(SLOWER, lane_change("cubic", "time", 3.0)),
            ],
            vec![(2.75, 177.475, 0.547), (3.5, 184.878, 1.75)],
        ),
        (
            "a linear change of lane by distance",
            vec![
                edit(
                    r#"<AbsoluteTargetSpeed value="20"/><!--ego speed-->"#,
                    r#"<AbsoluteTargetSpeed value="10"/>"#,
                ),
                edit(SLOWER, lane_change("linear", "distance", 30.0)),
            ],
            vec![(3.5, 184.899, 1.738), (12.0, 269.797, 3.5)],
        ),
        (
            "a cubic change of speed by time",
            slower_by(r#"dynamicsShape="cubic" dynamicsDimension="time" value="6""#),
            vec![(3.5, 184.508, 0.0), (12.0, 228.0, 0.0)],
        ),
        (
            "a factor of a speed that nothing changes",
            vec![edit(
                SLOWER,
                SLOWER.replace(
                    r#"<AbsoluteTargetSpeed value="4"/>"#,
                    r#"<RelativeTargetSpeed entityRef="Ego" value="0.2" speedTargetValueType="factor" continuous="true"/>"#,
                ),
            )],
            vec![(12.0, 228.0, 0.0)],
        ),
        (
            "an event that may repeat, and changes nothing when it does",
            vec![edit(
                r#"priority="override" maximumExecutionCount="1""#,
                r#"priority="override" maximumExecutionCount="2""#,
            )],
            vec![(12.0, 228.0, 0.0)],
        ),
        (
            "an act that waits for a distance",
            vec![
                edit(ACT, distance(&["Ego"], "lessThan", "none", "any", 80.0 - 4.4)),
                edit(FIRST, time(0.0, "none", 0.0)),
            ],
            vec![(12.0, 228.0, 0.0)],
        ),
        (
            "a travelled distance",
            vec![edit(FIRST, watch("Lead", r#"<TraveledDistanceCondition value="20"/>"#))],
            vec![(12.0, 228.0, 0.0)],
        ),
        (
            "a distance between reference points",
            vec![edit(
                FIRST,
                watch("Ego", r#"<RelativeDistanceCondition entityRef="Lead" relativeDistanceType="longitudinal" freespace="false" value="80" rule="lessThan"/>"#),
            )],
            vec![(12.0, 228.0, 0.0)],
        ),
        (
            "a headway between reference points",
            vec![edit(
                FIRST,
                watch("Ego", r#"<TimeHeadwayCondition entityRef="Lead" freespace="false" value="4" rule="lessThan"/>"#),
            )],
            vec![(12.0, 228.0, 0.0)],
        ),
        (
            "a place that is reached, to a tolerance",
            vec![edit(
                FIRST,
                watch("Lead", r#"<ReachPositionCondition tolerance="0.5"><Position><LanePosition roadId="0" laneId="-2" s="170"/></Position></ReachPositionCondition>"#),
            )],
            vec![(12.0, 227.7, 0.0)],
        ),
        (
            "a place in the world, on a lane",
            vec![edit(
                r#"<LanePosition roadId="0" laneId="-2" s="150" offset="0"/>"#,
                r#"<WorldPosition x="150" y="-5.25"/>"#,
            )],
            vec![(12.0, 228.0, 0.0)],
        ),
        (
            "parameters of a story, one with the sign of a reference in its name",
            vec![
                edit(
                    r#"<Story name="story">"#,
                    r#"<Story name="story"><ParameterDeclarations><ParameterDeclaration name="$owner" parameterType="string" value="Lead"/></ParameterDeclarations>"#,
                ),
                edit(
                    r#"<EntityRef entityRef="Lead"/></Actors>"#,
                    r#"<EntityRef entityRef="$owner"/></Actors>"#,
                ),
            ],
            vec![(12.0, 228.0, 0.0)],
        ),
        (
            "a lane change to an offset, and an offset within the lane that it leads to",
            vec![
                edit(r#"offset="0""#, r#"offset="0.25""#),
                edit(
                    r#"<AbsoluteTargetSpeed value="20"/><!--ego speed-->"#,
                    r#"<AbsoluteTargetSpeed value="10"/>"#,
                ),
                edit(SLOWER, CHANGE),
                second(&after("action", "slower", 1.0), CENTRE),
            ],
            vec![
                (2.0, 170.0, 0.25),
                (8.5, 234.852, 4.0),
                (12.0, 269.852, 3.5),
            ],
        ),
        (
            "an edge of what holds from the start on, when it comes again",
            vec![
                ego_at(90.0),
                edit(FIRST, distance(&["Ego"], "greaterThan", "rising", "any", 30.0)),
            ],
            vec![(9.0, 240.0, 0.0), (12.0, 266.723, 0.0)],
        ),
        (
            "an edge in an act that begins later",
            vec![edit(ACT, time(3.0, "none", 0.0)), edit(FIRST, nearer(20.0))],
            vec![(12.0, 260.1432, 0.0)],
        ),
        (
            "an edge that came before its act",
            vec![
                ego_at(140.0),
                edit(ACT, time(3.0, "none", 0.0)),
                edit(FIRST, nearer(20.0)),
            ],
            vec![(12.0, 270.0, 0.0)],
        ),
        (
            "a change of speed that waits beside a change of lane that waits",
            vec![
                edit(FIRST, nearer(40.0)),
                edit(SLOWER, lane_change("sinusoidal", "time", 3.0)),
                beside(&nearer(20.0), SLOWER),
            ],
            vec![(7.0, 219.886, 1.622), (8.0, 229.648, 3.197)],
        ),
        (
            "a change of speed that waits, and cuts a change of lane that waits",
            vec![
                edit(FIRST, nearer(40.0)),
                edit(SLOWER, lane_change("sinusoidal", "time", 3.0)),
                second(&nearer(20.0), SLOWER),
            ],
            vec![(7.0, 219.886, 1.622), (8.0, 229.689, 2.6)],
        ),
        (
            "a trajectory with corners at its own speed",
            at_start(trajectory(
                "<None/>",
                "",
                &[
                    (0.0, 150.0, -5.25),
                    (0.0, 180.0, -5.25),
                    (0.0, 200.0, 4.75),
                    (0.0, 290.0, 4.75),
                ],
            )),
            vec![(2.0, 170.0, 0.0), (4.0, 188.944, 4.472), (8.0, 227.639, 10.0)],
        ),
        (
            "a trajectory with times",
            at_start(timed("relative", 1.0, 0.0, "")),
            vec![(2.0, 170.0, 0.0), (4.0, 190.0, 5.0), (8.0, 215.0, 10.0)],
        ),
        (
            "a trajectory at half the pace, from a place on it",
            [vec![later()], at_start(timed("relative", 0.5, 0.0, offset))].concat(),
            vec![(4.0, 180.0, 0.0), (6.0, 190.0, 5.0), (8.0, 200.0, 10.0)],
        ),
        (
            "a trajectory with absolute times, ahead of which it is by an offset",
            [vec![later()], at_start(timed("absolute", 1.0, 1.0, ""))].concat(),
            vec![(2.0, 180.0, 0.0), (4.0, 200.0, 10.0), (6.0, 210.0, 10.0)],
        ),
        (
            "a profile of speeds",
            vec![
                slow_ego(),
                edit(SLOWER, profile(&[(2.0, 4.0), (1.0, 4.0), (3.0, 10.0)])),
            ],
            vec![(3.0, 178.5, 0.0), (4.5, 186.0, 0.0), (6.0, 193.0, 0.0), (10.0, 229.0, 0.0)],
        ),
        (
            "a profile that begins with a speed at once",
            vec![slow_ego(), edit(SLOWER, profile(&[(0.0, 6.0), (2.0, 4.0)]))],
            vec![(3.0, 175.5, 0.0), (4.5, 182.0, 0.0), (10.0, 204.0, 0.0)],
        ),
        (
            "a change of lane at once",
            vec![slow_ego(), edit(SLOWER, lane_change("step", "time", 0.0))],
            vec![(1.95, 169.5, 0.0), (2.5, 175.0, 3.5), (6.0, 210.0, 3.5)],
        ),
        (
            "a lane relative to somebody who faces against the road",
            [
                vec![
                    slow_ego(),
                    edit(
                        SLOWER,
                        lane_change("cubic", "time", 3.0)
                            .replace(r#"<AbsoluteTargetLane value="-1"/>"#, relative),
                    ),
                ],
                against,
            ]
            .concat(),
            vec![(3.5, 184.879, 1.75), (8.0, 229.754, 3.5)],
        ),
        (
            "an offset relative to somebody on another lane",
            [
                vec![
                    slow_ego(),
                    edit(
                        SLOWER,
                        CENTRE.replace(
                            r#"<AbsoluteTargetLaneOffset value="0"/>"#,
                            r#"<RelativeTargetLaneOffset entityRef="Other" value="-1"/>"#,
                        ),
                    ),
                ],
                third(),
            ]
            .concat(),
            vec![(3.5, 185.0, 0.965), (4.5, 195.0, 2.022)],
        ),
        (
            "a time to collision",
            vec![edit(
                FIRST,
                watch("Ego", r#"<TimeToCollisionCondition freespace="true" relativeDistanceType="longitudinal" value="5" rule="lessThan"><TimeToCollisionConditionTarget><EntityRef entityRef="Lead"/></TimeToCollisionConditionTarget></TimeToCollisionCondition>"#),
            )],
            vec![(6.0, 208.97, 0.0), (12.0, 243.36, 0.0)],
        ),
        (
            "a speed relative to another",
            vec![edit(
                FIRST,
                watch("Lead", r#"<RelativeSpeedCondition entityRef="Ego" value="-9" rule="lessThan"/>"#),
            )],
            vec![(12.0, 216.0, 0.0)],
        ),
        (
            "a headway to what is ahead only",
            vec![
                ego_at(140.0),
                edit(
                    FIRST,
                    watch("Lead", r#"<TimeHeadwayCondition entityRef="Ego" freespace="true" value="2" rule="greaterThan"/>"#),
                ),
            ],
            vec![(6.0, 206.71, 0.0), (12.0, 236.64, 0.0)],
        ),
        (
            "the first instant and a distance never come together",
            vec![edit(
                FIRST,
                format!(
                    "{}{}",
                    FIRST.replace(r#"value="2" rule="greaterThan""#, r#"value="0" rule="equalTo""#),
                    watch("Lead", r#"<TraveledDistanceCondition value="1"/>"#)
                ),
            )],
            vec![(12.0, 270.0, 0.0)],
        ),
        (
            "what follows a contact never begins, nor what follows that",
            vec![
                edit(FIRST, watch("Ego", r#"<CollisionCondition><EntityRef entityRef="Lead"/></CollisionCondition>"#)),
                second(&after("action", "slower", 0.0), FASTER),
            ],
            vec![(12.0, 270.0, 0.0)],
        ),
        (
            "a controller that nobody has moves nobody",
            vec![edit(
                "<!--lead init-->",
                r#"<PrivateAction><ControllerAction><ActivateControllerAction longitudinal="true" lateral="true"/></ControllerAction></PrivateAction>"#,
            )],
            vec![(12.0, 228.0, 0.0)],
        ),
    ];
    let mut wrong = Vec::new();
    for (name, edits, places) in cases {
        let imported = import(&files(&edits)).unwrap_or_else(|error| panic!("{name}: {error}"));
        let episode = run(&world(&imported));
        let off = places
            .iter()
            .filter_map(|place| off(&episode, "lead", *place));
        wrong.extend(off.map(|what| format!("{name}: {what}")));
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn a_bicycle_becomes_a_bicyclist_of_the_files_size() {
    let object = "<ScenarioObject name=\"Lead\">\n      <Vehicle name=\"sedan\" vehicleCategory=";
    let car =
        "<ScenarioObject name=\"Lead\">\n      <Vehicle name=\"sedan\" vehicleCategory=\"car\"";
    let bicycle = format!("{}\"bicycle\"", object.replace("sedan", "bike"));
    let imported = import(&files(&[edit(car, bicycle)])).expect("imported");
    let world = world(&imported);
    let agents = &world
        .drive()
        .expect("a driving world")
        .world()
        .spec()
        .agents;
    let body = |name: &str| {
        let agent = agents.iter().find(|agent| agent.name == name);
        &agent.expect("an agent").body
    };
    assert!(body("ego").vehicle().is_some() && body("ego").cyclist().is_none());
    let stock = Body::shipped("bicyclist").expect("shipped").expect("valid");
    let (bike, stock) = (body("lead"), stock.cyclist().expect("a cyclist"));
    let cyclist = bike.cyclist().expect("a cyclist");
    assert_eq!((bike.length_m, bike.width_m), (4.4, 1.8));
    assert!((bike.lever_m() - LEVER_M).abs() < 1e-9);
    assert_eq!(cyclist.wheelbase_m, 2.8);
    assert_eq!(
        (cyclist.brake_mps2, cyclist.power_w, cyclist.lean_rate_mps3),
        (stock.brake_mps2, stock.power_w, stock.lean_rate_mps3)
    );
    // A plan carries it, whatever its limits are.
    let episode = run(&world);
    for place in [(2.0, 170.0, 0.0), (12.0, 228.0, 0.0)] {
        assert_eq!(off(&episode, "lead", place), None);
    }
}

#[test]
fn an_init_adds_and_deletes_entities() {
    let global = |action: &str| {
        let text = format!("<GlobalAction>{action}</GlobalAction>");
        edit("<!--global-->", text)
    };
    let deleted = global(r#"<EntityAction entityRef="Lead"><DeleteEntityAction/></EntityAction>"#);
    let imported = import(&files(&[deleted])).expect("a world");
    assert!(!imported.worlds[0].text.contains("\"lead\""));
    // It stands where it is added.
    let object = third().remove(0);
    let added = global(
        r#"<EntityAction entityRef="Other"><AddEntityAction><Position><LanePosition roadId="0" laneId="-1" s="400"/></Position></AddEntityAction></EntityAction>"#,
    );
    let imported = import(&files(&[object, added])).expect("a world");
    let episode = run(&world(&imported));
    assert_eq!(off(&episode, "other", (0.0, 400.0, 3.5)), None);
    assert_eq!(off(&episode, "other", (6.0, 400.0, 3.5)), None);
    assert_eq!(off(&episode, "lead", (12.0, 228.0, 0.0)), None);
}

#[test]
fn an_ego_on_a_trajectory_with_times_begins_with_its_speed() {
    let way = timed("relative", 1.0, 0.0, "")
        .replace("-5.25", "-1.75")
        .replace(r#"x="150""#, r#"x="50""#)
        .replace(r#"x="180""#, r#"x="95""#);
    let init = format!("<PrivateAction>{way}</PrivateAction>");
    let files = files(&[edit("<!--ego init-->", init)]);
    let error = import(&files).expect_err("the file moves the ego");
    assert!(error.help.is_some(), "{error}");
    let imported = import_as(&files, (None, true), &[]).expect("a world");
    assert_eq!(imported.ego_events.len(), 1);
    let episode = run(&world(&imported));
    // 45 m in 3 s.
    assert_eq!(off(&episode, "ego", (2.0, 80.0, 3.5)), None);
}

#[test]
fn somebody_on_foot_waits_and_walks_around_a_corner() {
    let begins = r#"<Vehicle name="sedan""#;
    let (before, rest) = BASE
        .split_once(r#"<ScenarioObject name="Lead">"#)
        .expect("the lead");
    assert!(before.contains(begins));
    let (car, _) = rest.split_once("</Vehicle>").expect("a car");
    let car = format!(r#"<ScenarioObject name="Lead">{car}</Vehicle>"#);
    let walker = r#"<ScenarioObject name="Lead"><Pedestrian name="walker" mass="80" pedestrianCategory="pedestrian"><BoundingBox><Center x="0" y="0" z="0.9"/><Dimensions width="0.6" length="0.6" height="1.8"/></BoundingBox><Properties/></Pedestrian>"#;
    let stands = BASE.replace(&car, walker).replace(
        r#"<AbsoluteTargetSpeed value="10"/>"#,
        r#"<AbsoluteTargetSpeed value="0"/>"#,
    );
    // A slow ego comes there only later.
    let stands = stands.replace(
        r#"<AbsoluteTargetSpeed value="20"/><!--ego speed-->"#,
        r#"<AbsoluteTargetSpeed value="10"/>"#,
    );
    let way = trajectory(
        "<None/>",
        "",
        &[
            (0.0, 150.0, -5.25),
            (0.0, 150.0, -1.25),
            (0.0, 154.0, -1.25),
        ],
    );
    let speed = SLOWER.replace(r#"value="4""#, r#"value="1.5""#);
    let both =
        format!(r#"{speed}</PrivateAction></Action><Action name="way"><PrivateAction>{way}"#);
    let mut files = files(&[]);
    files[0].1 = stands.replace(SLOWER, &both);
    let imported = import(&files).expect("a world");
    let world = world(&imported);
    // The way is over after 8 m: at 1.5 m/s, of which the ramp takes 0.75 s.
    let horizon_s = world.world().clock().horizon_s;
    assert!((7.0..=8.1).contains(&horizon_s), "{horizon_s}");
    let episode = run(&world);
    let places = [(2.0, 150.0, 0.0), (4.0, 150.0, 1.875), (6.0, 150.875, 4.0)];
    for (time_s, x_m, y_m) in places {
        let (x, y) = at_by(&episode, "lead", time_s, 0.3);
        assert!((x - x_m).hypot(y - y_m) < 0.02, "({x}, {y}) at {time_s} s");
    }
}

/// A file with a change, what is said of it, and what stands on the line that is
/// named.
type Refusal = (Vec<Edit>, &'static str, &'static str);

fn refused_of_storyboards() -> Vec<Refusal> {
    let lead = |action: &str| {
        let action = format!("<PrivateAction>{action}</PrivateAction><!--added-->");
        vec![edit("<!--lead init-->", action)]
    };
    let slower = |from: &'static str, to: &str| vec![edit(SLOWER, SLOWER.replace(from, to))];
    let below = |edge: &str| distance(&["Ego"], "lessThan", edge, "any", 20.0);
    vec![
        (
            vec![
                edit(
                    r#"name="group" maximumExecutionCount="1""#,
                    r#"name="group" maximumExecutionCount="3""#,
                ),
                edit(
                    SLOWER,
                    SLOWER.replace(
                        r#"<AbsoluteTargetSpeed value="4"/>"#,
                        r#"<RelativeTargetSpeed entityRef="Ego" value="-4" speedTargetValueType="delta" continuous="false"/>"#,
                    ),
                ),
            ],
            "carried out 3 times",
            "<ManeuverGroup",
        ),
        (
            vec![edit(
                r#"selectTriggeringEntities="false""#,
                r#"selectTriggeringEntities="true""#,
            )],
            "those that trigger it",
            "<Actors",
        ),
        (
            vec![edit(FIRST, time(2.0, "falling", 0.0))],
            "falling edge",
            "falling",
        ),
        (
            vec![edit(FIRST, below("falling"))],
            "falling edge",
            "falling",
        ),
        (
            vec![
                edit(ACT, time(3.0, "none", 0.0)),
                edit(FIRST, time(2.0, "rising", 0.0)),
            ],
            "rising edge at 2 s is never seen",
            "rising",
        ),
        (
            vec![edit(FIRST, time(2.0, "none", -1.0))],
            "a delay of -1 s",
            "delay",
        ),
        (
            vec![second(&below("none"), FASTER)],
            "before the one before it has ended",
            "second",
        ),
        (
            vec![second(&after("event", "other", 0.0), FASTER)],
            "before the one before it has ended",
            "second",
        ),
        (
            vec![
                edit(
                    r#"<EntityRef entityRef="Lead"/>"#,
                    r#"<EntityRef entityRef="Lead"/><EntityRef entityRef="Other"/>"#,
                ),
                second(&after("event", "first", 0.0), FASTER),
            ]
            .into_iter()
            .chain(third())
            .collect(),
            "before the one before it has ended",
            "second",
        ),
        (
            vec![edit(
                "<!--act-->",
                format!(
                    "<StopTrigger><ConditionGroup>{}</ConditionGroup></StopTrigger>",
                    watch("Lead", r#"<TraveledDistanceCondition value="50"/>"#)
                ),
            )],
            "an act that is stopped in this way",
            "<StopTrigger>",
        ),
        (
            vec![edit(ACT, after("event", "first", 0.0))],
            "an act that waits",
            "<Act",
        ),
        (
            lead(
                r#"<LongitudinalAction><SpeedProfileAction><SpeedProfileEntry speed="3" time="5"/></SpeedProfileAction></LongitudinalAction>"#,
            ),
            "not read in Init",
            "SpeedProfileAction",
        ),
        (
            [
                lead(
                    r#"<ControllerAction><ActivateControllerAction longitudinal="true" lateral="false"/></ControllerAction>"#,
                ),
                vec![edit(
                    "<!--lead object-->",
                    r#"<ObjectController><Controller name="c"/></ObjectController>"#,
                )],
            ]
            .concat(),
            "that a controller moves",
            "ControllerAction",
        ),
        (
            vec![
                edit(SLOWER, trajectory("<None/>", "", &[(0.0, 150.0, -5.25), (0.0, 250.0, 5.0)])),
            ],
            "an agent that moves already",
            "FollowTrajectoryAction",
        ),
        (
            vec![
                edit(FIRST, time(0.0, "none", 0.0)),
                edit(SLOWER, trajectory("<None/>", "", &[(0.0, 150.0, -5.25), (0.0, 250.0, 5.0), (0.0, 160.0, -5.0)])),
            ],
            "turns back at a place",
            "FollowTrajectoryAction",
        ),
        (
            vec![
                edit(FIRST, time(0.0, "none", 0.0)),
                edit(
                    SLOWER,
                    trajectory("<None/>", "", &[(0.0, 150.0, -5.25), (0.0, 180.0, -5.25), (0.0, 220.0, 5.0)])
                        .replace(r#"y="5"/>"#, r#"y="5" h="1.5"/>"#),
                ),
            ],
            "whose places face elsewhere",
            "FollowTrajectoryAction",
        ),
        (
            vec![
                edit(FIRST, time(0.0, "none", 0.0)),
                edit(SLOWER, trajectory("<None/>", "", &[(0.0, 150.0, -5.25), (0.0, 250.0, 5.0)])),
                second(&time(2.0, "none", 0.0), FASTER),
            ],
            "that an event may cut",
            "second",
        ),
        (
            vec![edit(SLOWER, profile(&[(1.0, 2.0)]))],
            "a rate above 5 m/s²",
            "SpeedProfileAction",
        ),
        (
            lead(
                r#"<RoutingAction><AssignRouteAction><Route name="r" closed="false"><Waypoint routeStrategy="shortest"><Position><RelativeObjectPosition entityRef="Ego" dx="50" dy="40"/></Position></Waypoint></Route></AssignRouteAction></RoutingAction>"#,
            ),
            "a route that turns off",
            "AssignRouteAction",
        ),
        (
            slower(
                r#"<AbsoluteTargetSpeed value="4"/>"#,
                r#"<AbsoluteTargetSpeed value="-4"/>"#,
            ),
            "a speed of -4 m/s",
            "-4",
        ),
        (
            vec![second(
                &after("event", "first", 0.0),
                &FASTER.replace(
                    r#"<AbsoluteTargetSpeed value="10"/>"#,
                    r#"<RelativeTargetSpeed entityRef="Lead" value="0.5" speedTargetValueType="factor" continuous="false"/>"#,
                ),
            )],
            "relative to its own is not read",
            "second",
        ),
        (
            vec![edit(SLOWER, MEETING), edit(FIRST, time(0.0, "none", 0.0))],
            "a meeting with an agent that moves",
            "Synchronize",
        ),
        (
            vec![edit(
                SLOWER,
                r#"<LongitudinalAction><LongitudinalDistanceAction entityRef="Ego" freespace="true" continuous="false" displacement="leadingReferencedEntity" distance="9"/></LongitudinalAction>"#,
            )],
            "not read here",
            "LongitudinalDistanceAction",
        ),
        (
            vec![edit(r#"laneId="-2" s="150""#, r#"laneId="-2" s="1200""#)],
            "1200 m along road `0`, which has 1000 m",
            "LanePosition",
        ),
        (
            vec![edit(
                r#"<LanePosition roadId="0" laneId="-2" s="150" offset="0"/>"#,
                r#"<RelativeLanePosition entityRef="Ego" dLane="-1" ds="960"/>"#,
            )],
            "1010 m along road `0`, which has 1000 m",
            "RelativeLanePosition",
        ),
        (
            vec![rain("0.3")],
            "friction that changes on the way",
            "EnvironmentAction",
        ),
        (
            vec![edit(
                "<!--global-->",
                r#"<GlobalAction><TrafficAction trafficName="t"/></GlobalAction>"#,
            )],
            "not read in Init",
            "TrafficAction",
        ),
    ]
}

fn refused_of_roads() -> Vec<Refusal> {
    let line = r#"<geometry s="0" x="0" y="0" hdg="0" length="1000"><line/></geometry>"#;
    let two = |second: &str| {
        let first = line.replace("1000", "400");
        vec![edit(line, format!("{first}\n{second}"))]
    };
    let lane = "<!--lane-->";
    vec![
        (
            vec![edit(
                "<elevationProfile/>",
                r#"<elevationProfile><elevation s="0" a="0" b="-0.4" c="0" d="0"/></elevationProfile>"#,
            )],
            "it rises by -0.40 per metre",
            "<road",
        ),
        (
            two(r#"<geometry s="400" x="401" y="0" hdg="0" length="600"><line/></geometry>"#),
            "it begins 1.000 m off the end of the piece before it",
            "401",
        ),
        (
            two(r#"<geometry s="400" x="400" y="0" hdg="0.1" length="600"><line/></geometry>"#),
            "it begins turned by 0.1000 rad",
            "0.1",
        ),
        (
            two(r#"<geometry s="410" x="400" y="0" hdg="0" length="590"><line/></geometry>"#),
            "it begins at s = 410.000 m instead of 400.000 m",
            "410",
        ),
        (
            two(r#"<geometry s="400" x="400" y="0" hdg="0" length="500"><line/></geometry>"#),
            "that of its geometry 900.000 m",
            "<road",
        ),
        (
            vec![edit(
                "<!--offsets-->",
                "<laneOffset s=\"0\" a=\"0\"/>\n<laneOffset s=\"300\" a=\"3.5\"/>",
            )],
            "lane -1 of road `0` jumps",
            "Private",
        ),
        (
            vec![edit(
                "<!--offsets-->",
                r#"<laneOffset s="0" a="0" b="0.02"/>"#,
            )],
            "its lane slants",
            "Private",
        ),
        (
            vec![edit(
                lane,
                r#"<material sOffset="0" friction="0.8"/><material sOffset="100" friction="0.4"/>"#,
            )],
            "friction that changes",
            "material",
        ),
        (
            vec![edit(r#"length="4.4""#, r#"length="44""#)],
            "a body of 44 m",
            "<BoundingBox",
        ),
        (
            vec![edit(
                "<FrontAxle maxSteering=\"0.5\" wheelDiameter=\"0.6\" trackWidth=\"1.6\" positionX=\"2.8\" positionZ=\"0.3\"/>",
                "",
            )],
            "a trailer is not read",
            "<Axles",
        ),
        (
            vec![edit(
                r#"<LanePosition roadId="0" laneId="-1" s="50"/>"#,
                r#"<WorldPosition x="50" y="500"/>"#,
            )],
            "the ego is on no lane",
            "Private",
        ),
        (
            vec![edit(
                "<!--types-->",
                r#"<type s="0" type="town"><speed max="50" unit="knots"/></type>"#,
            )],
            "a speed limit in `knots`",
            "knots",
        ),
        (
            vec![
                edit(r#"filepath="straight.xodr""#, r#"filepath="bend.xodr""#),
                edit(
                    r#"<LanePosition roadId="0" laneId="-2" s="150" offset="0"/>"#,
                    r#"<RelativeLanePosition entityRef="Ego" dLane="0" dsLane="100"/>"#,
                ),
            ],
            "`dsLane` on a bend",
            "dsLane",
        ),
    ]
}

#[test]
fn what_would_move_otherwise_is_refused_by_file_line_and_cure() {
    let mut wrong = Vec::new();
    for (edits, what, on_line) in [refused_of_storyboards(), refused_of_roads()].concat() {
        let files = files(&edits);
        let Err(error) = import(&files) else {
            wrong.push(format!("{what}: it is imported"));
            continue;
        };
        let of = |name: &Path| files.iter().find(|(known, _)| Path::new(known) == name);
        let text = of(&error.file).map_or("", |(_, text)| text);
        let line = error.element.as_deref().map_or(0, |(_, line)| *line);
        let line = line.checked_sub(1).and_then(|line| text.lines().nth(line));
        let shown = error.to_string();
        if !shown.contains(what) {
            wrong.push(format!("{what}: it says {shown}"));
        }
        if line.is_none_or(|line| !line.contains(on_line)) {
            wrong.push(format!("{what}: it names {line:?}"));
        }
        if error.help.is_none() {
            wrong.push(format!("{what}: no help"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn friction_and_speed_limits_are_carried_over() {
    let wet = |scale: f64| {
        let text = format!(
            r#"<GlobalAction><EnvironmentAction><Environment name="wet"><Weather/><RoadCondition frictionScaleFactor="{scale}"/></Environment></EnvironmentAction></GlobalAction>"#
        );
        edit("<!--global-->", text)
    };
    let limit = |max: &str, unit: &str| {
        let text = format!(r#"<type s="0" type="town"><speed max="{max}" unit="{unit}"/></type>"#);
        edit("<!--types-->", text)
    };
    let surface = r#"<width sOffset="0" a="3.5" b="0" c="0" d="0"/>"#;
    let lanes = |text: &str| edit(surface, format!("{surface}{text}"));
    let cases: Vec<(Vec<Edit>, f64, Option<f64>)> = vec![
        (vec![], 1.0, None),
        (vec![wet(0.6)], 0.6, None),
        // Rain that changes nothing: the friction is that of the Init.
        (vec![wet(0.3), rain("0.3")], 0.3, None),
        (vec![rain("1.0")], 1.0, None),
        (
            vec![wet(0.5), lanes(r#"<material sOffset="0" friction="0.8"/>"#)],
            0.4,
            None,
        ),
        (vec![limit("50", "km/h")], 1.0, Some(50.0 / 3.6)),
        (vec![limit("no limit", "km/h")], 1.0, None),
        (vec![limit("30", "mph")], 1.0, Some(13.4112)),
        (
            vec![
                limit("50", "km/h"),
                lanes(r#"<speed sOffset="0" max="20" unit="m/s"/>"#),
            ],
            1.0,
            Some(20.0),
        ),
        // A limit that changes along the road, or from lane to lane, is none.
        (
            vec![edit(
                "<!--types-->",
                r#"<type s="0" type="town"><speed max="50" unit="km/h"/></type><type s="200" type="town"><speed max="30" unit="km/h"/></type>"#,
            )],
            1.0,
            None,
        ),
        (
            vec![edit(
                "<!--lane-->",
                r#"<speed sOffset="0" max="50" unit="km/h"/>"#,
            )],
            1.0,
            None,
        ),
    ];
    for (edits, friction, limit_mps) in cases {
        let imported = import(&files(&edits)).unwrap_or_else(|error| panic!("{edits:?}: {error}"));
        let world = world(&imported);
        let road = &world.drive().expect("a driving scene").spec().road;
        assert!((road.friction() - friction).abs() < 1e-9, "{edits:?}");
        let found = road.speed_limit_mps();
        let same = match (found, limit_mps) {
            (Some(a), Some(b)) => (a - b).abs() < 1e-6,
            (a, b) => a == b,
        };
        assert!(same, "{edits:?}: {found:?}");
    }
}

#[test]
fn what_is_dropped_is_listed_with_the_place_of_the_first() {
    let edits = [
        edit(
            "<lateralProfile/>",
            "<lateralProfile><superelevation s=\"0\" a=\"0\" b=\"0\" c=\"0\" d=\"0\"/>\n<superelevation s=\"10\" a=\"0\" b=\"0.005\" c=\"0\" d=\"0\"/><superelevation s=\"20\" a=\"0.05\" b=\"0\" c=\"0\" d=\"0\"/></lateralProfile>",
        ),
        edit(
            "<!--signals-->",
            r#"<signals><signal id="1" s="50" t="-6" dynamic="no"/></signals>"#,
        ),
        edit(
            "<!--lead vehicle-->",
            r#"<Trailer><CatalogReference catalogName="c" entryName="t"/></Trailer>"#,
        ),
        edit(
            "<!--ego init-->",
            r#"<PrivateAction><RoutingAction><AssignRouteAction><Route name="r" closed="false"><Waypoint routeStrategy="shortest"><Position><LanePosition roadId="0" laneId="-1" s="900"/></Position></Waypoint></Route></AssignRouteAction></RoutingAction></PrivateAction>"#,
        ),
        edit(
            "<!--global-->",
            r#"<GlobalAction><EnvironmentAction><Environment name="wet"><Weather/></Environment></EnvironmentAction></GlobalAction>"#,
        ),
        edit(
            r#"<Condition name="stop""#,
            r#"<Condition name="and" delay="0" conditionEdge="none"><ByEntityCondition/></Condition><Condition name="stop""#,
        ),
    ];
    let files = files(&edits);
    let imported = import(&files).expect("a world");
    let line_of = |file: &str, text: &str| {
        let (_, all) = files
            .iter()
            .find(|(name, _)| *name == file)
            .expect("a file");
        let found = all.lines().position(|line| line.contains(text));
        1 + found.unwrap_or_else(|| panic!("{text}"))
    };
    let expected = [
        ("trailers", "base.xosc", "<Trailer>", 1),
        ("weather", "base.xosc", "<Weather/>", 1),
        (
            "stop conditions",
            "base.xosc",
            "<StopTrigger><ConditionGroup>",
            1,
        ),
        ("lateral profile", "straight.xodr", "s=\"10\"", 2),
        ("traffic signals", "straight.xodr", "<signal ", 1),
        ("routes", "base.xosc", "<AssignRouteAction>", 1),
    ];
    let expected: Vec<(&str, &str, usize, usize)> = expected
        .iter()
        .map(|(kind, file, text, count)| (*kind, *file, line_of(file, text), *count))
        .collect();
    let of = |it: &'_ DroppedElements| (it.kind, it.file.display().to_string(), it.line, it.count);
    let found: Vec<_> = imported.dropped.iter().map(of).collect();
    let expected: Vec<_> = expected
        .iter()
        .map(|(kind, file, line, count)| (*kind, (*file).to_owned(), *line, *count))
        .collect();
    assert_eq!(found, expected);
    // What drops nothing lists nothing.
    let plain = import(&self::files(&[])).expect("a world");
    assert_eq!(plain.dropped, []);
}

#[test]
fn a_run_ends_before_anybody_leaves_its_road() {
    let horizon_s = |edits: &[Edit]| {
        let imported = import(&files(edits)).expect("a world");
        let cut = imported
            .dropped
            .iter()
            .any(|it| it.kind.contains("the end of a road"));
        {
            let world = world(&imported);
            (world.world().clock().horizon_s, cut)
        }
    };
    assert_eq!(horizon_s(&[]), (12.0, false));
    // 10 m/s from 950 m of 1000 m on, slower from 2 s on: 30 m at 10 - t m/s more.
    let far = edit(r#"laneId="-2" s="150""#, r#"laneId="-2" s="950""#);
    let (ends_s, cut) = horizon_s(std::slice::from_ref(&far));
    assert!(cut && (5.0..=5.7).contains(&ends_s), "{ends_s}");
    // An act that stops when the ego has travelled 100 m, at 20 m/s.
    let stopped = format!(
        "<StopTrigger><ConditionGroup>{}</ConditionGroup></StopTrigger>",
        watch("Ego", r#"<TraveledDistanceCondition value="100"/>"#)
    );
    assert_eq!(horizon_s(&[edit("<!--act-->", stopped)]), (5.0, false));
    // The ego coasts.
    let far = edit(r#"laneId="-1" s="50""#, r#"laneId="-1" s="900""#);
    assert_eq!(horizon_s(&[far]), (5.0, true));
}

#[test]
fn a_bend_goes_on_as_far_as_anybody_drives() {
    let edits = [
        edit(r#"filepath="straight.xodr""#, r#"filepath="bend.xodr""#),
        edit(
            r#"<SimulationTimeCondition value="12""#,
            r#"<SimulationTimeCondition value="52""#,
        ),
    ];
    let imported = import(&files(&edits)).expect("a world");
    let episode = run(&world(&imported));
    for time_s in [10.0, 30.0, 50.0] {
        // Lane -1 is 1.75 m to the right of an arc of 250 m, lane -2, on which the
        // world's road begins, 5.25 m.
        let radius_m: f64 = 251.75;
        let turned_rad: f64 = 50.0 / 250.0 + 20.0 * time_s / radius_m;
        let place = (
            time_s,
            radius_m * turned_rad.sin(),
            250.0 - radius_m * turned_rad.cos() + 5.25,
        );
        assert_eq!(off(&episode, "ego", place), None);
    }
}

#[test]
fn files_of_other_kinds_are_named_in_words_of_their_own() {
    let with = |name: &str, text: &str| {
        let mut all = files(&[]);
        let (_, content) = all.iter_mut().find(|(it, _)| *it == name).expect("a file");
        *content = text.to_owned();
        import(&all).expect_err("no XML").to_string()
    };
    for text in ["", "a car brakes & stops\n", "Scenario(\n    name: <b,\n)"] {
        let said = with("base.xosc", text);
        assert_eq!(said, "`base.xosc`: it is not an OpenSCENARIO XML file");
        let said = with("straight.xodr", text);
        assert!(said.starts_with("`straight.xodr`"), "{said}");
        let first = said.lines().next().unwrap_or_default();
        assert!(first.ends_with("it is not an OpenDRIVE XML file"), "{said}");
    }
    // In a file of the right kind, the place of the mistake is more useful.
    let said = with("base.xosc", &BASE.replacen("</Story>", "</Stori>", 1));
    assert!(said.contains("line ") && said.contains("Stori"), "{said}");
}

/// In world files a road goes straight on at both ends, so a road of nearly a full
/// circle would cross its beginning.
#[test]
fn a_road_of_nearly_a_full_circle_ends_before_it_comes_back() {
    let edits = [
        edit(r#"filepath="straight.xodr""#, r#"filepath="bend.xodr""#),
        edit(r#"curvature="0.004""#, r#"curvature="-0.004""#),
        edit(
            r#"<SimulationTimeCondition value="12""#,
            r#"<SimulationTimeCondition value="90""#,
        ),
    ];
    let imported = import(&files(&edits)).expect("a world");
    let episode = run(&world(&imported));
    // The run ends with the road, which the import says.
    let ends_s = 0.05 * (episode.trace.len() - 1) as f64;
    assert!((65.0..72.0).contains(&ends_s), "{ends_s} s");
    let kinds: Vec<&str> = imported.dropped.iter().map(|it| it.kind).collect();
    assert!(
        kinds.contains(&"what happens behind the end of a road"),
        "{kinds:?}"
    );
    // Lane -1 is 1.75 m inside an arc of 250 m, lane -2, on which the world's road
    // begins, 5.25 m.
    for row in 0..episode.trace.len() {
        let (x, y) = at(&episode, "ego", 0.05 * row as f64);
        let off_m = x.hypot(y + 244.75) - 248.25;
        assert!(off_m.abs() < 0.001, "{off_m} m off in row {row}");
    }
}

/// A gap is one between boxes that are turned against each other in a bend.
#[test]
fn a_gap_in_a_bend_counts_along_the_axis_of_the_car_ahead() {
    let gap = r#"<LongitudinalAction><LongitudinalDistanceAction entityRef="Ego" freespace="true" continuous="false" displacement="leadingReferencedEntity" distance="40"/></LongitudinalAction>"#;
    for curvature in ["0.004", "-0.004"] {
        let edits = [
            edit(r#"filepath="straight.xodr""#, r#"filepath="bend.xodr""#),
            edit(
                r#"curvature="0.004""#,
                format!(r#"curvature="{curvature}""#),
            ),
            edit(
                "<!--lead init-->",
                format!("<PrivateAction>{gap}</PrivateAction>"),
            ),
            edit(r#"laneId="-2" s="150""#, r#"laneId="-1" s="150""#),
        ];
        let imported = import(&files(&edits)).expect("a world");
        let episode = run(&world(&imported));
        let (ego, lead) = (at(&episode, "ego", 0.0), at(&episode, "lead", 0.0));
        let of = |name: &str| {
            episode
                .trace
                .signal(&format!("{name}.heading"))
                .expect("there")[0]
        };
        let (turned, h) = (of("ego"), of("lead"));
        // From the corners of the ego's front to the rear of the lead.
        let clear_m = [-0.9, 0.9].map(|side_m| {
            let x = ego.0 + LEVER_M * turned.cos() - side_m * turned.sin();
            let y = ego.1 + LEVER_M * turned.sin() + side_m * turned.cos();
            (lead.0 - x) * h.cos() + (lead.1 - y) * h.sin() - (4.4 - LEVER_M)
        });
        let clear_m = clear_m[0].min(clear_m[1]);
        assert!((clear_m - 40.0).abs() < 0.005, "{curvature}: {clear_m} m");
    }
}

#[test]
fn an_ego_has_any_name_and_its_events_are_left_only_on_request() {
    let renamed = files(&[edit("\"Ego\"", "\"Host\"")]);
    let unknown = import(&renamed).expect_err("nobody is called Ego");
    assert_eq!(
        unknown.help.as_deref(),
        Some("name the ego with --ego: Host, Lead")
    );
    let imported = import_as(&renamed, (Some("Host"), false), &[]).expect("a world");
    assert_eq!(imported.ego_events, []);
    let episode = run(&world(&imported));
    assert_eq!(off(&episode, "host", (6.0, 170.0, 3.5)), None);
    assert_eq!(off(&episode, "lead", (12.0, 228.0, 0.0)), None);
    // The lead is the ego: the file moves it at 2 s.
    let files = files(&[]);
    let error = import_as(&files, (Some("Lead"), false), &[]).expect_err("it has an event");
    assert!(
        error
            .to_string()
            .contains("the ego has a motion of its own")
    );
    let imported = import_as(&files, (Some("Lead"), true), &[]).expect("a world");
    let events: Vec<(&str, usize)> = imported
        .ego_events
        .iter()
        .map(|it| (it.name.as_str(), it.line))
        .collect();
    let line = BASE
        .lines()
        .position(|line| line.contains(r#"<Event name="first""#));
    assert_eq!(events, [("first", 1 + line.expect("the event"))]);
    let episode = run(&world(&imported));
    assert_eq!(off(&episode, "lead", (12.0, 270.0, 0.0)), None);
}

#[test]
fn a_map_by_name_is_a_file_on_request() {
    let files = files(&[edit(r#"filepath="straight.xodr""#, r#"filepath="Town""#)]);
    let error = import(&files).expect_err("no such file");
    assert_eq!(
        error.help.as_deref(),
        Some("name it with --road Town=FILE.xodr")
    );
    let maps = [("Town".to_owned(), PathBuf::from("straight.xodr"))];
    let imported = import_as(&files, (None, false), &maps).expect("a world");
    let episode = run(&world(&imported));
    assert_eq!(off(&episode, "lead", (12.0, 228.0, 0.0)), None);
}

/// The network, with the ego and the lead at places, and a route of the lead.
fn on_network(ego: &str, lead: &str, route: &str) -> Vec<Edit> {
    vec![
        edit(r#"filepath="straight.xodr""#, r#"filepath="network.xodr""#),
        edit(r#"<LanePosition roadId="0" laneId="-1" s="50"/>"#, ego),
        edit(
            r#"<LanePosition roadId="0" laneId="-2" s="150" offset="0"/>"#,
            lead,
        ),
        edit("<!--lead init-->", route),
        edit(
            r#"<AbsoluteTargetSpeed value="4"/>"#,
            r#"<AbsoluteTargetSpeed value="10"/>"#,
        ),
    ]
}

#[test]
fn a_route_turns_left_through_a_junction_before_an_ego_on_a_left_lane() {
    let stop = |road: u32| {
        format!(
            r#"<Waypoint routeStrategy="shortest"><Position><LanePosition roadId="{road}" laneId="-1" s="60"/></Position></Waypoint>"#
        )
    };
    let route = format!(
        r#"<PrivateAction><RoutingAction><AssignRouteAction><Route name="r" closed="false">{}{}</Route></AssignRouteAction></RoutingAction></PrivateAction>"#,
        stop(1),
        stop(2)
    );
    let ego = r#"<LanePosition roadId="3" laneId="1" s="50"/>"#;
    let lead_lane = r#"<LanePosition roadId="1" laneId="-1" s="60"/>"#;
    let imported = import(&files(&on_network(ego, lead_lane, &route))).expect("a world");
    // Lanes that turn off are read, so no route is dropped.
    assert!(imported.dropped.iter().all(|it| it.kind != "routes"));
    let episode = run(&world(&imported));
    // The world begins at the end of road 3, on its left lane, and faces west.
    let seen = |time_s: f64, x_m: f64, y_m: f64| (time_s, 340.0 - x_m, 1.75 - y_m);
    assert_eq!(off(&episode, "ego", seen(6.0, 70.0, 1.75)), None);
    // 40 m of road 1, then a quarter of a circle, 21.75 m around (100, 20), and on.
    let turned_rad: f64 = 20.0 / 21.75;
    let lead = [
        seen(4.0, 100.0, -1.75),
        seen(
            6.0,
            100.0 + 21.75 * turned_rad.sin(),
            20.0 - 21.75 * turned_rad.cos(),
        ),
        seen(
            9.0,
            121.75,
            20.0 + 50.0 - 21.75 * core::f64::consts::FRAC_PI_2,
        ),
    ];
    for place in lead {
        assert_eq!(off(&episode, "lead", place), None);
    }
    // Without a route, the way of the lead ends at the junction, after 4 s.
    let imported = import(&files(&on_network(ego, lead_lane, ""))).expect("a world");
    let horizon_s = world(&imported).world().clock().horizon_s;
    assert!((3.9..=4.0).contains(&horizon_s), "{horizon_s}");
}

#[test]
fn a_polynomial_of_a_reference_line_is_followed_to_the_centimetre() {
    let line = "<line/>";
    let curve = r#"<paramPoly3 pRange="arcLength" aU="0" bU="1" cU="0" dU="0" aV="0" bV="0" cV="0.00001" dV="0"/>"#;
    let imported = import(&files(&[edit(line, curve)])).expect("a world");
    let episode = run(&world(&imported));
    // y = x²/100000, 1.75 m to its right, in the frame of lane -2, 5.25 m to its
    // right. As a line it would be 0.29 m off.
    assert_eq!(off(&episode, "ego", (6.0, 170.006, 3.789)), None);
    assert_eq!(off(&episode, "lead", (2.0, 170.018, 0.289)), None);
}

#[test]
fn the_ego_drives_on_the_grades_of_its_road_and_past_its_lights() {
    let rises = "<elevationProfile><elevation s=\"0\" a=\"0\" b=\"0\" c=\"0\" d=\"0\"/>\
                 <elevation s=\"100\" a=\"0\" b=\"-0.04\" c=\"0\" d=\"0\"/></elevationProfile>";
    let signals = r#"<signals>
        <signal id="1" s="250" t="-6" dynamic="yes" orientation="+"/>
        <signal id="2" s="250" t="6" dynamic="yes" orientation="-"/>
        <signal id="3" s="300" t="-6" dynamic="yes" orientation="+"/>
        <signal id="4" s="350" t="-6" dynamic="yes" orientation="+"/>
        </signals>"#;
    // The first two are switched one by one, the third by its group 7, 5 s after them.
    let phases = r#"<TrafficSignals>
        <TrafficSignalController name="main"><Phase name="go" duration="20"><TrafficSignalState trafficSignalId="1" state="off;off;on"/><TrafficSignalState trafficSignalId="2" state="on;off;off"/></Phase><Phase name="stop" duration="10"><TrafficSignalState trafficSignalId="1" state="on;off;off"/><TrafficSignalState trafficSignalId="2" state="off;off;on"/></Phase></TrafficSignalController>
        <TrafficSignalController name="7" delay="5" reference="main"><Phase name="go" duration="20"><TrafficSignalGroupState state="green"/></Phase><Phase name="stop" duration="10"><TrafficSignalGroupState state="red"/></Phase></TrafficSignalController>
        </TrafficSignals>"#;
    let files = files(&[
        edit("<elevationProfile/>", rises),
        edit("<!--signals-->", signals),
        edit("<!--network-->", phases),
        edit(
            "</OpenDRIVE>",
            "<controller id=\"7\" name=\"c\"><control signalId=\"3\"/></controller></OpenDRIVE>",
        ),
    ]);
    let imported = import(&files).expect("a world");
    let world = world(&imported);
    let spec = world.drive().expect("a driving world").spec();
    let grades: Vec<(f64, f64)> = spec
        .grades
        .iter()
        .map(|it| (it.from_s_m, it.rise))
        .collect();
    assert_eq!(grades, [(0.0, 0.0), (100.0, -0.04)]);
    let lights: Vec<(&str, f64)> = spec
        .lights
        .iter()
        .map(|it| (it.name.as_str(), it.line_m))
        .collect();
    assert_eq!(lights, [("light_1", 250.0), ("light_3", 300.0)]);
    // The ego keeps its speed downhill.
    let episode = run(&world);
    let speeds = episode.trace.signal("ego.speed").expect("recorded");
    assert!(speeds.iter().all(|mps| (mps - 20.0).abs() < 0.03));
    let text = world.text();
    for schedule in [
        "line_m: 250.0, drive: Schedule([(0.0, Green), (20.0, Red), (30.0, Green), ",
        "line_m: 300.0, drive: Schedule([(0.0, Red), (5.0, Green), (25.0, Red), (35.0, Green), ",
    ] {
        assert!(text.contains(schedule), "{text}");
    }
    // The light of the other direction and the one without phases are listed.
    let dropped: Vec<(&str, usize)> = imported
        .dropped
        .iter()
        .map(|it| (it.kind, it.count))
        .collect();
    assert_eq!(dropped, [("traffic signals", 2)]);
}
