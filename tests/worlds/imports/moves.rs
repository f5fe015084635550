//! Motion of the lead, event by event.

use super::*;

#[test]
fn small_scenarios_move_as_their_files_say() {
    // Lane -2, on which the lead starts, is the world's lane 0.
    let near = || ego_at(140.0);
    let late = |act_s: f64| [act(time(act_s, "none", 0.0)), first(nearer(20.0, "none"))];
    let both = |needs: &str| distance(&["Ego", "Other"], "lessThan", "rising", needs, 20.0);
    let offset = r#" initialDistanceOffset="10""#;
    let against = || {
        let lane = r#"<LanePosition roadId="0" laneId="-1" s="120" offset="0"/>"#;
        let turned =
            format!(r#"<LanePosition roadId="0" laneId="-2" s="900">{TURNED}</LanePosition>"#);
        third().map(|it| edit(it.from, it.to.replace(lane, &turned)))
    };
    let behind_other = r#"<RelativeTargetLane entityRef="Other" value="-1"/>"#;
    let beside_other = r#"<RelativeTargetLaneOffset entityRef="Other" value="-1"/>"#;
    let parameter = r#"<Condition name="c" delay="3" conditionEdge="none"><ByValueCondition><ParameterCondition parameterRef="on" rule="equalTo" value="1"/></ByValueCondition></Condition>"#;
    let declared = r#"<ParameterDeclarations><ParameterDeclaration name="on" parameterType="integer" value="1"/></ParameterDeclarations><CatalogLocations/>"#;
    let owner = r#"<Story name="story"><ParameterDeclarations><ParameterDeclaration name="$owner" parameterType="string" value="Lead"/></ParameterDeclarations>"#;
    let reached = r#"<ReachPositionCondition tolerance="0.5"><Position><LanePosition roadId="0" laneId="-2" s="170"/></Position></ReachPositionCondition>"#;
    let collision = r#"<TimeToCollisionCondition freespace="true" relativeDistanceType="longitudinal" value="5" rule="lessThan"><TimeToCollisionConditionTarget><EntityRef entityRef="Lead"/></TimeToCollisionConditionTarget></TimeToCollisionCondition>"#;
    let arrival = r#"<TimeToCollisionCondition freespace="false" relativeDistanceType="longitudinal" value="3" rule="lessThan"><TimeToCollisionConditionTarget><Position><LanePosition roadId="0" laneId="-2" s="200"/></Position></TimeToCollisionConditionTarget></TimeToCollisionCondition>"#;
    let step = SLOWER.replace(
        r#"dynamicsShape="linear" dynamicsDimension="rate" value="1""#,
        r#"dynamicsShape="step" dynamicsDimension="time" value="0""#,
    );
    let worded = r#"<ParameterDeclarations><ParameterDeclaration name="shape" parameterType="string" value="linear"/></ParameterDeclarations><CatalogLocations><RouteCatalog/></CatalogLocations>"#;
    let assigned = r#"<PrivateAction><ControllerAction><AssignControllerAction><Controller name="c"><Properties/></Controller></AssignControllerAction></ControllerAction></PrivateAction>"#;
    let own_lane = lane_change("linear", "time", 4.0).replace(r#"value="-1""#, r#"value="-2""#);
    let headway = |kind: &str| {
        let of = r#"entityRef="Lead" freespace="false" value="0.3" rule="lessThan""#;
        watch("Ego", &format!("<TimeHeadwayCondition {of} {kind}/>"))
    };
    let once = r#"priority="override" maximumExecutionCount="1""#;
    let curve = r#"<paramPoly3 pRange="arcLength" aU="0" bU="1" cU="0" dU="0" aV="0" bV="0" cV="0.00001" dV="0"/>"#;
    table! {
        "as it is": [] => lead([(2.0, 170.0, 0.0), (12.0, 228.0, 0.0)]);
        "an act within the first second begins when it says":
            [act(time(0.6, "none", 0.0)), first(time(0.0, "none", 0.0))] => lead([(12.0, 219.6, 0.0)]);
        "a time just after the start is seen in the first sample":
            [from_start(step)] => lead([(0.05, 150.2, 0.0), (12.0, 198.0, 0.0)]);
        "a time to a place": [first(watch("Lead", arrival))] => lead([(12.0, 228.0, 0.0)]);
        "an event does not begin before its act":
            [act(time(5.0, "none", 0.0))] => lead([(12.0, 246.0, 0.0)]);
        "a rising edge of a time":
            [first(time(2.0, "rising", 0.0))] => lead([(12.0, 228.0, 0.0)]);
        "either edge of a time that only rises":
            [first(time(2.0, "risingOrFalling", 0.0))] => lead([(12.0, 228.0, 0.0)]);
        "a delay": [first(time(2.0, "rising", 1.5))] => lead([(12.0, 237.0, 0.0)]);
        "the delay of what holds from the start on":
            [first(parameter), edit("<ParameterDeclarations/>\n  <CatalogLocations/>", declared)]
            => lead([(12.0, 234.0, 0.0)]);
        "any of two is near": [third(), first(both("any"))] => lead([(5.0, 192.4728, 0.0)]);
        "all of two are near":
            [third(), first(both("all"))] => lead([(5.0, 200.0, 0.0), (12.0, 260.1432, 0.0)]);
        "far apart behind an overtaking, too":
            [near(), first(distance(&["Ego"], "greaterThan", "rising", "any", 30.0))]
            => lead([(12.0, 242.64, 0.0)]);
        "near after the act has begun": [late(3.0)] => lead([(12.0, 260.1432, 0.0)]);
        "near as the act begins": [late(3.0), near()] => lead([(12.0, 234.0, 0.0)]);
        "one event after the other":
            [second(&after("event", "first", 1.0), FASTER)]
            => lead([(9.0, 216.0, 0.0), (12.0, 237.0, 0.0)]);
        "a speed that is reached after the start, and changes again before":
            [edit(
                r#"dynamicsShape="step" dynamicsDimension="time" value="0"/><!--init dynamics-->"#,
                r#"dynamicsShape="linear" dynamicsDimension="rate" value="3"/>"#,
            )] => lead([(2.0, 156.0, 0.0), (12.0, 198.0, 0.0)]);
        "a change of speed that replaces the one before it":
            [second(&time(4.0, "none", 0.0), FASTER)]
            => lead([(4.0, 188.0, 0.0), (12.0, 267.0, 0.0)]);
        "a change of lane beside a change of speed that goes on":
            [slow_ego(), beside(&time(4.0, "none", 0.0), CHANGE)]
            => lead([(4.0, 188.0, 0.0), (7.0, 207.376, 1.859)]);
        "a change of speed beside a change of lane that goes on":
            [slow_ego(), does(CHANGE), beside(&time(4.0, "none", 0.0), SLOWER)]
            => lead([(6.0, 207.870, 2.832), (9.0, 227.318, 4.0)]);
        "a cubic change of lane by time":
            [slow_ego(), does(lane_change("cubic", "time", 3.0))]
            => lead([(2.75, 177.475, 0.547), (3.5, 184.878, 1.75)]);
        "a linear change of lane by distance":
            [slow_ego(), does(lane_change("linear", "distance", 30.0))]
            => lead([(3.5, 184.899, 1.738), (12.0, 269.797, 3.5)]);
        "a cubic change of speed by time":
            [does(SLOWER.replace(
                r#"dynamicsShape="linear" dynamicsDimension="rate" value="1""#,
                r#"dynamicsShape="cubic" dynamicsDimension="time" value="6""#,
            ))] => lead([(3.5, 184.508, 0.0), (12.0, 228.0, 0.0)]);
        "a factor of a speed that nothing changes":
            [aims_at(r#"<RelativeTargetSpeed entityRef="Ego" value="0.2" speedTargetValueType="factor" continuous="true"/>"#)]
            => lead([(12.0, 228.0, 0.0)]);
        // 8 m/s faster at once, though a body gains 10 m/s in a second.
        "a step to a factor of a speed that goes on":
            [aims_at(r#"<RelativeTargetSpeed entityRef="Ego" value="0.9" speedTargetValueType="factor" continuous="true"/>"#),
             edit(r#"dynamicsShape="linear" dynamicsDimension="rate" value="1""#, r#"dynamicsShape="step" dynamicsDimension="time" value="0""#)]
            => lead([(2.1, 171.8, 0.0), (12.0, 350.0, 0.0)]);
        "an event that may repeat, and changes nothing when it does":
            [edit(once, once.replace('1', "2"))] => lead([(12.0, 228.0, 0.0)]);
        "an act that waits for a distance":
            [act(nearer(80.0 - 4.4, "none")), first(time(0.0, "none", 0.0))]
            => lead([(12.0, 228.0, 0.0)]);
        "a travelled distance": [first(travelled("Lead", 20.0))] => lead([(12.0, 228.0, 0.0)]);
        "a distance between reference points":
            [first(watch("Ego", r#"<RelativeDistanceCondition entityRef="Lead" relativeDistanceType="longitudinal" freespace="false" value="80" rule="lessThan"/>"#))]
            => lead([(12.0, 228.0, 0.0)]);
        "a headway between reference points":
            [first(watch("Ego", r#"<TimeHeadwayCondition entityRef="Lead" freespace="false" value="4" rule="lessThan"/>"#))]
            => lead([(12.0, 228.046, 0.0)]);
        "a place that is reached, to a tolerance":
            [first(watch("Lead", reached))] => lead([(12.0, 227.7, 0.0)]);
        "a place in the world, on a lane":
            [edit(LEAD, r#"<WorldPosition x="150" y="-5.25"/>"#)] => lead([(12.0, 228.0, 0.0)]);
        "parameters of a story, one with the sign of a reference in its name":
            [
                edit(r#"<Story name="story">"#, owner),
                edit(r#"<EntityRef entityRef="Lead"/></Actors>"#, r#"<EntityRef entityRef="$owner"/></Actors>"#),
            ] => lead([(12.0, 228.0, 0.0)]);
        "a lane change to an offset, and an offset within the lane that it leads to":
            [
                edit(r#"offset="0""#, r#"offset="0.25""#),
                slow_ego(),
                does(CHANGE),
                second(&after("action", "slower", 1.0), CENTRE),
            ] => lead([(2.0, 170.0, 0.25), (8.5, 234.852, 4.0), (12.0, 269.852, 3.5)]);
        "an edge of what holds from the start on, when it comes again":
            [ego_at(90.0), first(distance(&["Ego"], "greaterThan", "rising", "any", 30.0))]
            => lead([(9.0, 240.0, 0.0), (12.0, 266.723, 0.0)]);
        "an edge in an act that begins later":
            [act(time(3.0, "none", 0.0)), first(nearer(20.0, "rising"))]
            => lead([(12.0, 260.1432, 0.0)]);
        "an edge that came before its act":
            [near(), act(time(3.0, "none", 0.0)), first(nearer(20.0, "rising"))]
            => lead([(12.0, 270.0, 0.0)]);
        "a change of speed that waits beside a change of lane that waits":
            [
                first(nearer(40.0, "rising")),
                does(lane_change("sinusoidal", "time", 3.0)),
                beside(&nearer(20.0, "rising"), SLOWER),
            ] => lead([(7.0, 219.886, 1.622), (8.0, 229.648, 3.197)]);
        "a change of speed that waits, and cuts a change of lane that waits":
            [
                first(nearer(40.0, "rising")),
                does(lane_change("sinusoidal", "time", 3.0)),
                second(&nearer(20.0, "rising"), SLOWER),
            ] => lead([(7.0, 219.883, 1.64), (8.0, 229.688, 2.571)]);
        "a trajectory with corners at its own speed":
            [from_start(way([[150.0, -5.25], [180.0, -5.25], [200.0, 4.75], [290.0, 4.75]]))]
            => lead([(2.0, 170.0, 0.0), (4.0, 188.944, 4.472), (8.0, 227.639, 10.0)]);
        "a trajectory with times":
            [from_start(timed("relative", 1.0, 0.0, ""))]
            => lead([(2.0, 170.0, 0.0), (4.0, 190.0, 5.0), (8.0, 215.0, 10.0)]);
        "a trajectory at half the pace, from a place on it":
            [lead_at(160.0), from_start(timed("relative", 2.0, 0.0, offset))]
            => lead([(4.0, 180.0, 0.0), (6.0, 190.0, 5.0), (8.0, 200.0, 10.0)]);
        "a trajectory with absolute times, ahead of which it is by an offset":
            [lead_at(160.0), from_start(timed("absolute", 1.0, -1.0, ""))]
            => lead([(2.0, 180.0, 0.0), (4.0, 200.0, 10.0), (6.0, 210.0, 10.0)]);
        "a trajectory at half the pace, for which it waits a second":
            [from_start(timed("relative", 2.0, 1.0, ""))]
            => lead([(1.0, 150.0, 0.0), (5.0, 170.0, 0.0), (9.0, 190.0, 5.0)]);
        "a profile of speeds":
            [slow_ego(), does(profile(&[(2.0, 4.0), (1.0, 4.0), (3.0, 10.0)]))]
            => lead([(3.0, 178.5, 0.0), (4.5, 186.0, 0.0), (6.0, 193.0, 0.0), (10.0, 229.0, 0.0)]);
        "a profile that begins with a speed at once":
            [slow_ego(), does(profile(&[(0.0, 6.0), (2.0, 4.0)]))]
            => lead([(3.0, 175.5, 0.0), (4.5, 182.0, 0.0), (10.0, 204.0, 0.0)]);
        "a change of lane at once":
            [slow_ego(), does(lane_change("step", "time", 0.0))]
            => lead([(1.95, 169.5, 0.0), (2.5, 175.0, 3.5), (6.0, 210.0, 3.5)]);
        "a lane relative to an agent that faces against the road":
            [
                slow_ego(),
                does(lane_change("cubic", "time", 3.0).replace(r#"<AbsoluteTargetLane value="-1"/>"#, behind_other)),
                against(),
            ] => lead([(3.5, 184.879, 1.75), (8.0, 229.754, 3.5)]);
        "an offset relative to an agent on another lane":
            [
                slow_ego(),
                does(CENTRE.replace(r#"<AbsoluteTargetLaneOffset value="0"/>"#, beside_other)),
                third(),
            ] => lead([(3.5, 185.0, 0.965), (4.5, 195.0, 2.022)]);
        "a clear distance to a place":
            [first(watch("Lead", r#"<DistanceCondition value="20" freespace="true" rule="lessThan"><Position><LanePosition roadId="0" laneId="-2" s="200"/></Position></DistanceCondition>"#))]
            => lead([(12.0, 231.84, 0.0)]);
        "a clear distance to a place at an agent, whose box does not count":
            [first(watch("Ego", r#"<DistanceCondition value="80" freespace="true" coordinateSystem="entity" relativeDistanceType="longitudinal" rule="lessThan"><Position><RelativeObjectPosition entityRef="Lead" dx="0" dy="0"/></Position></DistanceCondition>"#))]
            => lead([(12.0, 225.84, 0.0)]);
        "a time to collision":
            [first(watch("Ego", collision))] => lead([(6.0, 208.97, 0.0), (12.0, 243.36, 0.0)]);
        "a speed relative to another":
            [first(watch("Lead", r#"<RelativeSpeedCondition entityRef="Ego" value="-9" rule="lessThan"/>"#))]
            => lead([(12.0, 216.0, 0.0)]);
        "a word that is a parameter, and a list of catalogs that names none":
            [
                edit("<ParameterDeclarations/>\n  <CatalogLocations/>", worded),
                edit(r#"dynamicsShape="linear""#, r#"dynamicsShape="$shape""#),
            ] => lead([(12.0, 228.0, 0.0)]);
        "a controller that only the ego gets":
            [
                edit("<!--ego init-->", assigned),
                lead_init(r#"<ControllerAction><ActivateControllerAction longitudinal="true" lateral="true"/></ControllerAction>"#),
            ] => lead([(12.0, 228.0, 0.0)]);
        "a change to its own lane, which ends at once":
            [does(own_lane), second(&after("event", "first", 0.0), SLOWER)]
            => lead([(12.0, 228.0, 0.0)]);
        "a profile in the Init":
            [lead_init(&profile(&[(5.0, 3.0)]))] => lead([(2.0, 167.2, 0.0), (12.0, 212.32, 0.0)]);
        "a change of lane in the Init":
            [lead_init(&lane_change("linear", "time", 4.0))]
            => lead([(2.0, 169.923, 1.75), (7.0, 207.338, 3.5)]);
        "a headway along the straight line between two lanes":
            [near(), first(headway(""))] => lead([(12.0, 219.076, 0.0)]);
        "a headway along the axis":
            [near(), first(headway(r#"relativeDistanceType="longitudinal""#))]
            => lead([(12.0, 218.4, 0.0)]);
        "a headway along the road":
            [near(), first(headway(r#"alongRoute="true""#))] => lead([(12.0, 218.4, 0.0)]);
        "a headway to what is ahead only":
            [
                near(),
                first(watch("Lead", r#"<TimeHeadwayCondition entityRef="Ego" freespace="true" value="2" rule="greaterThan"/>"#)),
            ] => lead([(6.0, 206.71, 0.0), (12.0, 236.597, 0.0)]);
        "the first instant and a distance never come together":
            [first(
                FIRST.replace(r#"value="2" rule="greaterThan""#, r#"value="0" rule="equalTo""#)
                    + &travelled("Lead", 1.0),
            )] => lead([(12.0, 270.0, 0.0)]);
        "what follows a contact never begins, nor what follows that":
            [
                first(watch("Ego", r#"<CollisionCondition><EntityRef entityRef="Lead"/></CollisionCondition>"#)),
                second(&after("action", "slower", 0.0), FASTER),
            ] => lead([(12.0, 270.0, 0.0)]);
        "a controller that no agent has moves none":
            [lead_init(r#"<ControllerAction><ActivateControllerAction longitudinal="true" lateral="true"/></ControllerAction>"#)]
            => lead([(12.0, 228.0, 0.0)]);
        // y = x²/100000, 1.75 m to its right, in the frame of lane -2, 5.25 m to its
        // right. As a line it would be 0.29 m off.
        "an ego along a polynomial of a reference line":
            [edit("<line/>", curve)] => ego([(6.0, 170.006, 3.789)]);
        "a lead along it": [edit("<line/>", curve)] => lead([(2.0, 170.018, 0.289)]);
    }
}
