//! The small scenario, and changes of its files.

use super::*;

pub const BASE: &str = include_str!("base.xosc");
pub const STRAIGHT: &str = include_str!("straight.xodr");
const ROADS: [(&str, &str); 3] = [
    ("straight.xodr", STRAIGHT),
    ("bend.xodr", include_str!("bend.xodr")),
    ("network.xodr", include_str!("network.xodr")),
];

pub const EGO: &str = r#"<LanePosition roadId="0" laneId="-1" s="50"/>"#;
pub const LEAD: &str = r#"<LanePosition roadId="0" laneId="-2" s="150" offset="0"/>"#;
pub const LEAD_S: &str = r#"laneId="-2" s="150""#;
pub const TURNED: &str = r#"<Orientation type="relative" h="3.141592653589793"/>"#;
pub const EGO_SPEED: &str = r#"<AbsoluteTargetSpeed value="20"/><!--ego speed-->"#;
pub const LEAD_SPEED: &str = r#"<AbsoluteTargetSpeed value="10"/>"#;
pub const STANDING: &str = r#"<AbsoluteTargetSpeed value="0"/>"#;
/// The speed to which the first event leads.
pub const LATER_SPEED: &str = r#"<AbsoluteTargetSpeed value="4"/>"#;
pub const PLAN: &str = r#"<geometry s="0" x="0" y="0" hdg="0" length="1000"><line/></geometry>"#;
pub const WIDTH: &str = r#"<width sOffset="0" a="3.5" b="0" c="0" d="0"/>"#;
pub const STOP: &str = r#"<Condition name="stop" delay="0" conditionEdge="none"><ByValueCondition><SimulationTimeCondition value="12" rule="greaterThan"/></ByValueCondition></Condition>"#;

/// When the first event begins, and the act around it.
pub const FIRST: &str = r#"<Condition name="first begins" delay="0" conditionEdge="none"><ByValueCondition><SimulationTimeCondition value="2" rule="greaterThan"/></ByValueCondition></Condition>"#;
pub const ACT: &str = r#"<Condition name="act begins" delay="0" conditionEdge="none"><ByValueCondition><SimulationTimeCondition value="0" rule="greaterOrEqual"/></ByValueCondition></Condition>"#;
pub const UNKNOWN: &str = r#"<Condition name="u" delay="0" conditionEdge="none"><ByValueCondition><UserDefinedValueCondition name="x" rule="equalTo" value="1"/></ByValueCondition></Condition>"#;
/// What the first event does.
pub const SLOWER: &str = r#"<LongitudinalAction><SpeedAction>
                <SpeedActionDynamics dynamicsShape="linear" dynamicsDimension="rate" value="1"/>
                <SpeedActionTarget><AbsoluteTargetSpeed value="4"/></SpeedActionTarget>
              </SpeedAction></LongitudinalAction>"#;
pub const FASTER: &str = r#"<LongitudinalAction><SpeedAction><SpeedActionDynamics dynamicsShape="linear" dynamicsDimension="rate" value="2"/><SpeedActionTarget><AbsoluteTargetSpeed value="10"/></SpeedActionTarget></SpeedAction></LongitudinalAction>"#;
pub const CHANGE: &str = r#"<LateralAction><LaneChangeAction targetLaneOffset="0.5"><LaneChangeActionDynamics dynamicsShape="sinusoidal" dynamicsDimension="rate" value="1"/><LaneChangeTarget><AbsoluteTargetLane value="-1"/></LaneChangeTarget></LaneChangeAction></LateralAction>"#;
pub const CENTRE: &str = r#"<LateralAction><LaneOffsetAction continuous="false"><LaneOffsetActionDynamics dynamicsShape="sinusoidal" maxLateralAcc="1"/><LaneOffsetTarget><AbsoluteTargetLaneOffset value="0"/></LaneOffsetTarget></LaneOffsetAction></LateralAction>"#;
pub const MEETING: &str = r#"<SynchronizeAction masterEntityRef="Ego"><TargetPositionMaster><LanePosition roadId="0" laneId="-1" s="300"/></TargetPositionMaster><TargetPosition><LanePosition roadId="0" laneId="-2" s="200"/></TargetPosition><FinalSpeed><AbsoluteSpeed value="10"><TargetDistanceSteadyState distance="5"/></AbsoluteSpeed></FinalSpeed></SynchronizeAction>"#;

/// A change of the files: a text, and what stands in its place.
#[derive(Clone, Debug)]
pub struct Edit {
    pub from: String,
    pub to: String,
}

pub fn edit(from: impl Into<String>, to: impl Into<String>) -> Edit {
    Edit {
        from: from.into(),
        to: to.into(),
    }
}

/// One edit or several, as a row of a table lists them.
pub trait IntoEdits {
    fn into_edits(self) -> Vec<Edit>;
}

impl IntoEdits for Edit {
    fn into_edits(self) -> Vec<Edit> {
        vec![self]
    }
}

impl IntoEdits for Vec<Edit> {
    fn into_edits(self) -> Vec<Edit> {
        self
    }
}

impl<const N: usize> IntoEdits for [Edit; N] {
    fn into_edits(self) -> Vec<Edit> {
        self.into()
    }
}

/// The files with changes, each of which must apply somewhere.
pub fn files(edits: &[Edit]) -> Vec<(&'static str, String)> {
    let mut all = vec![("base.xosc", BASE.to_owned())];
    all.extend(ROADS.map(|(name, text)| (name, text.to_owned())));
    for Edit { from, to } in edits {
        let mut applied = false;
        for (_, text) in &mut all {
            applied |= text.contains(from);
            *text = text.replace(from, to);
        }
        assert!(applied, "{from}");
    }
    all
}

/// Names of the files that edits change.
pub fn edited_files(edits: &[Edit]) -> Vec<&'static str> {
    let before = files(&[]).into_iter();
    let pairs = before.zip(files(edits));
    let changed = pairs.filter(|(before, after)| before.1 != after.1);
    changed.map(|(before, _)| before.0).collect()
}

pub fn first(condition: impl Into<String>) -> Edit {
    edit(FIRST, condition)
}

pub fn act(condition: impl Into<String>) -> Edit {
    edit(ACT, condition)
}

/// Another action of the first event.
pub fn does(action: impl Into<String>) -> Edit {
    edit(SLOWER, action)
}

/// Another action of the first event, which begins with the run.
pub fn from_start(action: impl Into<String>) -> [Edit; 2] {
    [first(time(0.0, "none", 0.0)), does(action)]
}

/// Another target of the first event's speed.
pub fn aims_at(target: &str) -> Edit {
    does(SLOWER.replace(LATER_SPEED, target))
}

pub fn ego_at(s_m: f64) -> Edit {
    edit(r#"laneId="-1" s="50""#, format!(r#"laneId="-1" s="{s_m}""#))
}

pub fn lead_at(s_m: f64) -> Edit {
    edit(LEAD_S, format!(r#"laneId="-2" s="{s_m}""#))
}

pub fn slow_ego() -> Edit {
    edit(EGO_SPEED, LEAD_SPEED)
}

pub fn on_bend() -> Edit {
    edit(r#"filepath="straight.xodr""#, r#"filepath="bend.xodr""#)
}

pub fn on_network() -> Edit {
    edit(r#"filepath="straight.xodr""#, r#"filepath="network.xodr""#)
}

/// The time at which the file stops.
pub fn until(time_s: &str) -> Edit {
    let condition = |time_s: &str| format!(r#"<SimulationTimeCondition value="{time_s}""#);
    edit(condition("12"), condition(time_s))
}

pub fn lead_init(action: &str) -> Edit {
    let action = format!("<PrivateAction>{action}</PrivateAction><!--added-->");
    edit("<!--lead init-->", action)
}

pub fn global(action: &str) -> Edit {
    let action = format!("<GlobalAction>{action}</GlobalAction>");
    edit("<!--global-->", action)
}

pub fn time(at_s: f64, edge: &str, delay_s: f64) -> String {
    format!(
        r#"<Condition name="c" delay="{delay_s}" conditionEdge="{edge}"><ByValueCondition><SimulationTimeCondition value="{at_s}" rule="greaterThan"/></ByValueCondition></Condition>"#
    )
}

/// A clear distance to the lead of some of the others.
pub fn distance(who: &[&str], rule: &str, edge: &str, needs: &str, value_m: f64) -> String {
    let who: String = who
        .iter()
        .map(|name| format!(r#"<EntityRef entityRef="{name}"/>"#))
        .collect();
    format!(
        r#"<Condition name="c" delay="0" conditionEdge="{edge}"><ByEntityCondition><TriggeringEntities triggeringEntitiesRule="{needs}">{who}</TriggeringEntities><EntityCondition><RelativeDistanceCondition entityRef="Lead" relativeDistanceType="longitudinal" freespace="true" value="{value_m}" rule="{rule}"/></EntityCondition></ByEntityCondition></Condition>"#
    )
}

/// The ego is nearer to the lead than a clear distance.
pub fn nearer(value_m: f64, edge: &str) -> String {
    distance(&["Ego"], "lessThan", edge, "any", value_m)
}

/// Another condition of an entity.
pub fn watch(who: &str, condition: &str) -> String {
    format!(
        r#"<Condition name="c" delay="0" conditionEdge="none"><ByEntityCondition><TriggeringEntities triggeringEntitiesRule="any"><EntityRef entityRef="{who}"/></TriggeringEntities><EntityCondition>{condition}</EntityCondition></ByEntityCondition></Condition>"#
    )
}

pub fn travelled(who: &str, value_m: f64) -> String {
    let condition = format!(r#"<TraveledDistanceCondition value="{value_m}"/>"#);
    watch(who, &condition)
}

pub fn after(kind: &str, name: &str, delay_s: f64) -> String {
    format!(
        r#"<Condition name="c" delay="{delay_s}" conditionEdge="none"><ByValueCondition><StoryboardElementStateCondition storyboardElementType="{kind}" storyboardElementRef="{name}" state="endTransition"/></ByValueCondition></Condition>"#
    )
}

pub fn lane_change(shape: &str, dimension: &str, value: f64) -> String {
    format!(
        r#"<LateralAction><LaneChangeAction><LaneChangeActionDynamics dynamicsShape="{shape}" dynamicsDimension="{dimension}" value="{value}"/><LaneChangeTarget><AbsoluteTargetLane value="-1"/></LaneChangeTarget></LaneChangeAction></LateralAction>"#
    )
}

/// A trajectory of the lead: times with places, and how its times count.
pub fn trajectory(timing: &str, attributes: &str, places: &[Place]) -> String {
    let vertices: String = places.iter().map(|(time_s, x_m, y_m)| {
        format!(
            r#"<Vertex time="{time_s}"><Position><WorldPosition x="{x_m}" y="{y_m}"/></Position></Vertex>"#
        )
    }).collect();
    format!(
        r#"<RoutingAction><FollowTrajectoryAction{attributes}><TrajectoryRef><Trajectory name="t" closed="false"><Shape><Polyline>{vertices}</Polyline></Shape></Trajectory></TrajectoryRef><TimeReference>{timing}</TimeReference><TrajectoryFollowingMode followingMode="position"/></FollowTrajectoryAction></RoutingAction>"#
    )
}

/// A trajectory of the lead without times.
pub fn way<const N: usize>(places: [[f64; 2]; N]) -> String {
    let places = places.map(|[x_m, y_m]| (0.0, x_m, y_m));
    trajectory("<None/>", "", &places)
}

/// A trajectory with a corner, of which the times are those of a kind.
pub fn timed(domain: &str, scale: f64, offset_s: f64, attributes: &str) -> String {
    let timing = format!(
        r#"<Timing domainAbsoluteRelative="{domain}" scale="{scale}" offset="{offset_s}"/>"#
    );
    let places = [
        (0.0, 150.0, -5.25),
        (3.0, 180.0, -5.25),
        (5.0, 200.0, 4.75),
        (9.0, 220.0, 4.75),
    ];
    trajectory(&timing, attributes, &places)
}

/// A profile of speeds, in durations and speeds.
pub fn profile(entries: &[(f64, f64)]) -> String {
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

/// One more event of the lead.
pub fn second(condition: &str, action: &str) -> Edit {
    let text = format!(
        r#"<Event name="second" priority="override"><Action name="other"><PrivateAction>{action}</PrivateAction></Action><StartTrigger><ConditionGroup>{condition}</ConditionGroup></StartTrigger></Event>"#
    );
    edit("<!--events-->", text)
}

/// The event that follows the first, beside it.
pub fn beside(condition: &str, action: &str) -> Edit {
    let Edit { from, to } = second(condition, action);
    let parallel = to.replace(r#"priority="override""#, r#"priority="parallel""#);
    edit(from, parallel)
}

/// A story of its own that changes nothing but the friction.
pub fn rain(scale: &str) -> Edit {
    let text = format!(
        r#"</Actions></Init>
<Story name="weather"><Act name="rain"><ManeuverGroup name="rain" maximumExecutionCount="1"><Actors selectTriggeringEntities="false"/><Maneuver name="rain"><Event name="rain" priority="override"><Action name="rain"><GlobalAction>
<EnvironmentAction><Environment name="rain"><RoadCondition frictionScaleFactor="{scale}"/></Environment></EnvironmentAction>
</GlobalAction></Action><StartTrigger><ConditionGroup>{FIRST}</ConditionGroup></StartTrigger></Event></Maneuver></ManeuverGroup><StartTrigger><ConditionGroup>{ACT}</ConditionGroup></StartTrigger></Act></Story>"#
    );
    edit("</Actions></Init>", text)
}

/// A third car, on the ego's lane: its object and its place.
pub fn third() -> [Edit; 2] {
    let object = lead_object("<!--entities-->").replace("Lead", "Other");
    let (_, rest) = BASE
        .split_once(r#"<Private entityRef="Lead">"#)
        .expect("the lead");
    let (text, _) = rest.split_once("</Actions>").expect("the end");
    let placed = format!(r#"<Private entityRef="Lead">{text}"#)
        .replace("Lead", "Other")
        .replace(LEAD_S, r#"laneId="-1" s="120""#)
        .replace(r#"value="10"/>"#, r#"value="15"/>"#);
    [
        edit("<!--entities-->", object),
        edit("</Actions></Init>", format!("{placed}</Actions></Init>")),
    ]
}

/// The text of the lead's object, up to a text.
pub fn lead_object(to: &str) -> String {
    let from = r#"<ScenarioObject name="Lead">"#;
    let (_, rest) = BASE.split_once(from).expect("the lead");
    let (text, _) = rest.split_once(to).expect("its end");
    format!("{from}{text}")
}

/// The lead as a pedestrian.
pub fn lead_on_foot() -> Edit {
    let walker = r#"<ScenarioObject name="Lead"><Pedestrian name="walker" mass="80" pedestrianCategory="pedestrian"><BoundingBox><Center x="0" y="0" z="0.9"/><Dimensions width="0.6" length="0.6" height="1.8"/></BoundingBox><Properties/></Pedestrian>"#;
    edit(lead_object("</Vehicle>") + "</Vehicle>", walker)
}

/// The road of the straight file, without its end.
pub fn straight_road() -> &'static str {
    let (_, road) = STRAIGHT.split_once("<road ").expect("a road");
    let (road, _) = road.split_once("</OpenDRIVE>").expect("its end");
    road
}
