//! Files of which no world has the motion: refused by line, with a fix.

use super::*;

#[test]
fn storyboards_that_would_move_otherwise_are_refused_by_line_and_fix() {
    let turned_off = r#"<RoutingAction><AssignRouteAction><Route name="r" closed="false"><Waypoint routeStrategy="shortest"><Position><RelativeObjectPosition entityRef="Ego" dx="50" dy="40"/></Position></Waypoint></Route></AssignRouteAction></RoutingAction>"#;
    table! {
        "a delay below 0": [first(time(2.0, "none", -1.0))] => on("delay", "a delay of -1 s");
        "an event after itself":
            [second(&after("event", "other", 0.0), FASTER)]
            => on("StoryboardElementStateCondition", "no `event` called `other`");
        "a controller of the lead":
            [
                lead_init(r#"<ControllerAction><ActivateControllerAction longitudinal="true" lateral="false"/></ControllerAction>"#),
                edit("<!--lead object-->", r#"<ObjectController><Controller name="c"/></ObjectController>"#),
            ] => on("ControllerAction", "that a controller moves");
        "a route that turns off":
            [lead_init(turned_off)] => on("AssignRouteAction", "a route that turns off");
        "a speed below 0":
            [aims_at(r#"<AbsoluteTargetSpeed value="-4"/>"#)] => on("-4", "a speed of -4 m/s");
        "a place behind the end of its road":
            [lead_at(1200.0)] => on("LanePosition", "1200 m along road `0`, which has 1000 m");
        "a place beside the ego, behind the end of its road":
            [edit(LEAD, r#"<RelativeLanePosition entityRef="Ego" dLane="-1" ds="960"/>"#)]
            => on("RelativeLanePosition", "1010 m along road `0`, which has 1000 m");
        "traffic around":
            [global(r#"<TrafficAction trafficName="t"/>"#)] => on("TrafficAction", "not read in Init");
    }
}

#[test]
fn roads_that_no_world_has_are_refused_by_line_and_fix() {
    let two = |second: &str| {
        let first = PLAN.replace("1000", "400");
        edit(PLAN, format!("{first}\n{second}"))
    };
    let axle = "<FrontAxle maxSteering=\"0.5\" wheelDiameter=\"0.6\" trackWidth=\"1.6\" positionX=\"2.8\" positionZ=\"0.3\"/>";
    let steep =
        r#"<elevationProfile><elevation s="0" a="0" b="-0.4" c="0" d="0"/></elevationProfile>"#;
    let along_lane = r#"<RelativeLanePosition entityRef="Ego" dLane="0" dsLane="100"/>"#;
    table! {
        "a fall of 40 %":
            [edit("<elevationProfile/>", steep)] => on("<road", "it rises by -0.40 per metre");
        "a piece off the end of another":
            [two(r#"<geometry s="400" x="401" y="0" hdg="0" length="600"><line/></geometry>"#)]
            => on("401", "it begins 1.000 m off the end of the piece before it");
        "a piece turned against another":
            [two(r#"<geometry s="400" x="400" y="0" hdg="0.1" length="600"><line/></geometry>"#)]
            => on("0.1", "it begins turned by 0.1000 rad");
        "a piece with another station":
            [two(r#"<geometry s="410" x="400" y="0" hdg="0" length="590"><line/></geometry>"#)]
            => on("410", "it begins at s = 410.000 m instead of 400.000 m");
        "pieces shorter than their road":
            [two(r#"<geometry s="400" x="400" y="0" hdg="0" length="500"><line/></geometry>"#)]
            => on("<road", "that of its geometry 900.000 m");
        "a lane that jumps soon":
            [edit("<!--offsets-->", "<laneOffset s=\"0\" a=\"0\"/>\n<laneOffset s=\"160\" a=\"3.5\"/>")]
            => on("Private", "lane -2 of road `0` jumps");
        "a lane that slants":
            [edit("<!--offsets-->", r#"<laneOffset s="0" a="0" b="0.02"/>"#)]
            => on("Private", "its lane slants");
        "a body that is too long":
            [edit(r#"length="4.4""#, r#"length="44""#)] => on("<BoundingBox", "a body of 44 m");
        "a body with one axle": [edit(axle, "")] => on("<Axles", "a trailer is not read");
        "an ego that drives off the road":
            [edit(EGO, r#"<WorldPosition x="50" y="500"/>"#)] => on("Private", "the ego is on no lane");
        "a limit in knots":
            [edit("<!--types-->", r#"<type s="0" type="town"><speed max="50" unit="knots"/></type>"#)]
            => on("knots", "a speed limit in `knots`");
        "a distance along a lane on a bend":
            [on_bend(), edit(LEAD, along_lane)] => on("dsLane", "`dsLane` on a bend");
    }
}

#[test]
fn what_another_player_reads_otherwise_is_refused() {
    let gap = |more: &str| {
        from_start(format!(
            r#"<LongitudinalAction><LongitudinalDistanceAction entityRef="Ego" freespace="true" continuous="false" distance="30"{more}</LongitudinalDistanceAction></LongitudinalAction>"#
        ))
    };
    let leading = r#" displacement="leadingReferencedEntity">"#;
    let system = |system: &str| {
        let kind = r#"relativeDistanceType="longitudinal""#;
        let with = format!(r#"{kind} coordinateSystem="{system}""#);
        first(nearer(20.0, "none").replace(kind, &with))
    };
    table! {
        "a distance in the world": [system("world")] => says("the coordinate system `world`");
        "a distance along a trajectory":
            [system("trajectory")] => says("the coordinate system `trajectory`");
        // These are read without the causes above.
        "a gap before the ego": [gap(leading)] => lead([]);
        "a distance along the lane": [system("lane")] => lead([]);
    }
}
