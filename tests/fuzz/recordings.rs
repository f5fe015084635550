//! Recordings: refused by name, or read and analysed within bounds.

use brakecheck_traffic::{
    Analysis, BoundRules, DrivingBehaviour, ReadError, TrafficModel, TrafficRecording,
    TrafficRuleFile, read_csv_guessed, read_lanelets, read_mcap, read_osi, read_xml, read_xosc,
};
use proptest::prelude::*;
use proptest::sample::{Index, select};

use super::corpus::Source;
use super::harness::{Bytes, Seen, Target};
use super::mutate::mutants;

/// Rows of two vehicles, of which one changes lanes behind the other.
fn rows(header: &str, line: impl Fn(f64, &str, [f64; 4]) -> String) -> String {
    let mut text = format!("{header}\n");
    for i in 0..40 {
        let t = 0.1 * f64::from(i);
        let share = (t / 4.0).clamp(0.0, 1.0);
        text += &line(t, "1", [20.0 * t, 0.0, 0.0, 20.0]);
        text += &line(t, "2", [30.0 + 18.0 * t, 3.5 * (1.0 - share), 0.0, 18.0]);
    }
    text
}

fn csv() -> Vec<Source> {
    let generic = rows(
        "time,id,x,y,heading,speed,length,width",
        |t, id, [x, y, h, v]| format!("{t:.1},{id},{x:.2},{y:.2},{h},{v},4.5,1.8\n"),
    );
    let ngsim = rows(
        "Vehicle_ID,Global_Time,Local_X,Local_Y,v_length,v_Width,v_Class,v_Vel,v_Acc",
        |t, id, [x, y, _, v]| {
            let (ms, feet) = ((1000.0 * t).round(), 1.0 / 0.3048);
            format!(
                "{id},{ms},{},{},15,6,2,{},0\n",
                -y * feet,
                x * feet,
                v * feet
            )
        },
    );
    let named = rows("x;y;vx;vy;object_id;time_ms", |t, id, [x, y, _, v]| {
        format!("{x};{y};{v};-0.875;{id};{}\n", 1000.0 * t)
    });
    let highd = rows(
        "frame,id,x,y,width,height,xVelocity,yVelocity,xAcceleration,yAcceleration",
        |t, id, [x, y, _, v]| {
            let frame = (10.0 * t).round();
            format!(
                "{frame},{id},{},{},4.5,1.8,{},0,0,0\n",
                0.4 * x,
                10.0 - y,
                v
            )
        },
    );
    vec![
        Source::new("generic", generic),
        Source::new("ngsim", ngsim),
        Source::new("named", named),
        Source::new("highd", highd),
    ]
}

fn xml() -> Vec<Source> {
    let mut fcd = String::from("<fcd-export>\n");
    for i in 0..30 {
        let x = 2.0 * f64::from(i);
        fcd += &format!(
            "<timestep time=\"{:.1}\"><vehicle id=\"a\" x=\"{x}\" y=\"0\" angle=\"90\" \
             type=\"car\" speed=\"20\"/></timestep>\n",
            0.1 * f64::from(i)
        );
    }
    fcd += "</fcd-export>\n";
    let mut xosc = String::from(
        "<OpenSCENARIO><Entities><ScenarioObject name=\"a\"><Vehicle name=\"c\" \
         vehicleCategory=\"car\"/></ScenarioObject></Entities><Private entityRef=\"a\">\
         <Trajectory name=\"t\"><Shape><Polyline>\n",
    );
    for i in 0..30 {
        xosc += &format!(
            "<Vertex time=\"{:.1}\"><Position><WorldPosition x=\"{}\" y=\"0\"/></Position></Vertex>\n",
            0.1 * f64::from(i),
            2 * i
        );
    }
    xosc += "</Polyline></Shape></Trajectory><Timing domainAbsoluteRelative=\"absolute\" \
             scale=\"1\" offset=\"0\"/></Private></OpenSCENARIO>\n";
    let osm = "<osm><node id='1'><tag k='local_x' v='0'/><tag k='local_y' v='0'/></node>\
               <node id='2'><tag k='local_x' v='50'/><tag k='local_y' v='0'/></node>\
               <node id='3'><tag k='local_x' v='0'/><tag k='local_y' v='3'/></node>\
               <node id='4'><tag k='local_x' v='50'/><tag k='local_y' v='3'/></node>\
               <way id='5'><nd ref='1'/><nd ref='2'/></way><way id='6'><nd ref='3'/><nd ref='4'/></way>\
               <relation id='7'><member ref='6' role='left'/><member ref='5' role='right'/>\
               <tag k='type' v='lanelet'/></relation></osm>";
    let state = |step: usize, name: &str| {
        format!(
            "<{name}><position><point><x>{}</x><y>1</y></point></position><orientation>\
             <exact>0</exact></orientation><time><exact>{step}</exact></time><velocity>\
             <exact>20</exact></velocity></{name}>",
            2 * step
        )
    };
    let states: String = (1..30).map(|step| state(step, "state")).collect();
    let commonroad = format!(
        "<commonRoad timeStepSize=\"0.1\"><dynamicObstacle id=\"5\"><type>car</type><shape>\
         <rectangle><length>4.5</length><width>1.8</width></rectangle></shape>{}<trajectory>\
         {states}</trajectory></dynamicObstacle></commonRoad>",
        state(0, "initialState")
    );
    vec![
        Source::new("commonroad", commonroad),
        Source::new("fcd", fcd),
        Source::new("xosc", xosc),
        Source::new("osm", osm),
    ]
}

/// Analyses a recording with all rules, or reads its error.
fn used(read: Result<TrafficRecording, ReadError>) -> Seen {
    let recording = match read {
        Ok(recording) => recording,
        Err(error) => {
            assert!(!error.to_string().is_empty() && !error.help().is_empty());
            return Seen::Refused;
        }
    };
    assert!(recording.dt_s.is_finite() && recording.dt_s > 0.0);
    let analysis = Analysis::of(recording);
    let rules = TrafficRuleFile::parse(TrafficRuleFile::motorway_text()).expect("shipped");
    let bound = BoundRules::bind(&rules, &analysis.recording).expect("shipped");
    // Without a motor vehicle there is nothing to evaluate.
    let _ = bound.evaluate(&analysis.recording, &analysis.frame, &analysis.leads);
    assert!(!format!("{:?}", analysis.summary()).is_empty());
    Seen::Accepted
}

#[test]
fn any_csv_of_a_recording_is_refused_or_analysed() {
    let target = Target {
        name: "log",
        cases: 1500,
        shrinks: 300,
        least_percent: (15, 15),
    };
    target.run(&mutants(csv().into()), |mutant| {
        used(read_csv_guessed(mutant.text.as_bytes(), "log.csv").map(|it| it.0))
    });
}

#[test]
fn any_xml_of_a_recording_or_a_map_is_refused_or_analysed() {
    let target = Target {
        name: "log_xml",
        cases: 1500,
        shrinks: 300,
        least_percent: (10, 15),
    };
    target.run(&mutants(xml().into()), |mutant| {
        let text = mutant.text.as_bytes();
        if let Err(error) = read_lanelets(text, "map.osm") {
            assert!(!error.help().is_empty());
        }
        if text.starts_with(b"<OpenSCENARIO") {
            used(read_xosc(text, "log.xosc"))
        } else {
            used(read_xml(text, "log.xml").map(|it| it.0))
        }
    });
}

/// Damage of bytes.
#[derive(Clone, Debug)]
enum Damage {
    /// A byte becomes another one, or changes by some bits.
    Set(Index, u8),
    Flip(Index, u8),
    /// Eight bytes become a number, as lengths are written.
    Number(Index, u64),
    /// Bytes are left out, or are there twice.
    Drop(Index, usize),
    Double(Index, usize),
    Truncate(Index),
}

impl Damage {
    fn of(&self, bytes: &mut Vec<u8>) {
        let place = |at: &Index| at.index(bytes.len().max(1)).min(bytes.len());
        let span = |at: &Index, count: usize| place(at)..(place(at) + count).min(bytes.len());
        match self {
            Damage::Set(at, value) => {
                let at = span(at, 1);
                bytes[at].fill(*value);
            }
            Damage::Flip(at, bits) => {
                let at = span(at, 1);
                bytes[at].iter_mut().for_each(|it| *it ^= bits);
            }
            Damage::Number(at, number) => {
                let at = span(at, 8);
                let number = &number.to_le_bytes()[..at.len()];
                bytes[at].copy_from_slice(number);
            }
            Damage::Drop(at, count) => {
                let at = span(at, *count);
                bytes.drain(at);
            }
            Damage::Double(at, count) => {
                let at = span(at, *count);
                let again = bytes[at.clone()].to_vec();
                bytes.splice(at.start..at.start, again);
            }
            Damage::Truncate(at) => bytes.truncate(place(at)),
        }
    }
}

fn damages() -> impl Strategy<Value = Vec<Damage>> {
    let place = any::<Index>;
    let byte = || select(vec![0_u8, 1, 0x7f, 0x80, 0xff]);
    let number = select(vec![0, 1, 1 << 20, 1 << 27, u64::from(u32::MAX), u64::MAX]);
    let damage = prop_oneof![
        6 => (place(), byte()).prop_map(|(at, value)| Damage::Set(at, value)),
        4 => (place(), byte()).prop_map(|(at, bits)| Damage::Flip(at, bits)),
        2 => (place(), number).prop_map(|(at, number)| Damage::Number(at, number)),
        2 => (place(), 1..300usize).prop_map(|(at, count)| Damage::Drop(at, count)),
        2 => (place(), 1..900usize).prop_map(|(at, count)| Damage::Double(at, count)),
        1 => place().prop_map(Damage::Truncate),
    ];
    prop::collection::vec(damage, 1..5)
}

const GT_OSI: &[u8] = include_bytes!("../../crates/traffic/tests/data/gt.osi");
const SV_OSI: &[u8] = include_bytes!("../../crates/traffic/tests/data/sv.osi");
const PLAIN: &[u8] = include_bytes!("../../crates/traffic/tests/data/gt_none.mcap");
const LZ4: &[u8] = include_bytes!("../../crates/traffic/tests/data/gt_lz4.mcap");
const ZSTD: &[u8] = include_bytes!("../../crates/traffic/tests/data/sv_zstd.mcap");

#[test]
fn any_osi_trace_is_refused_or_analysed() {
    let target = Target {
        name: "log_osi",
        cases: 1200,
        shrinks: 300,
        least_percent: (5, 20),
    };
    let spoilt = (select(vec![GT_OSI, SV_OSI]), damages()).prop_map(|(good, damages)| {
        let mut bytes = good.to_vec();
        damages.iter().for_each(|it| it.of(&mut bytes));
        Bytes(bytes)
    });
    target.run(&spoilt, |bytes| used(read_osi(&bytes.0[..], "log.osi")));
}

/// Returns the records in the first chunk of a file whose chunks are not compressed.
fn records_of_chunk(file: &[u8]) -> &[u8] {
    let number = |at: usize| u64::from_le_bytes(file[at..at + 8].try_into().expect("8")) as usize;
    let mut at = 8;
    while file[at] != 0x06 {
        at += 9 + number(at + 1);
    }
    // Two instants, a size, a checksum, an empty text and a length.
    let from = at + 9 + 16 + 8 + 4 + 4 + 8;
    &file[from..from + number(from - 8)]
}

/// Returns a file of one chunk with these records, so that their damage has no checksum.
///
/// Both compressions may store bytes as they are.
fn with_records(records: &[u8], compression: &str) -> Vec<u8> {
    let size = records.len() as u32;
    let packed = match compression {
        "lz4" => {
            let head = [0x04, 0x22, 0x4d, 0x18, 0x60, 0x40, 0x82];
            let length = (size | 0x8000_0000).to_le_bytes();
            [&head[..], &length, records, &[0; 4]].concat()
        }
        "zstd" => {
            let head = [0x28, 0xb5, 0x2f, 0xfd, 0, 0x58];
            let last = (size << 3 | 1).to_le_bytes();
            [&head[..], &last[..3], records].concat()
        }
        _ => records.to_vec(),
    };
    let content = [
        &[0; 16][..],
        &u64::from(size).to_le_bytes(),
        &[0; 4],
        &(compression.len() as u32).to_le_bytes(),
        compression.as_bytes(),
        &(packed.len() as u64).to_le_bytes(),
        &packed,
    ]
    .concat();
    let record = |kind: u8, content: &[u8]| {
        [&[kind][..], &(content.len() as u64).to_le_bytes(), content].concat()
    };
    let (chunk, end) = (record(0x06, &content), record(0x0f, &[0; 4]));
    [b"\x89MCAP0\r\n", &chunk[..], &end].concat()
}

#[test]
fn any_mcap_trace_is_refused_or_analysed() {
    let target = Target {
        name: "log_mcap",
        cases: 1200,
        shrinks: 300,
        least_percent: (5, 20),
    };
    let whole = (select(vec![PLAIN, LZ4, ZSTD]), damages()).prop_map(|(good, damages)| {
        let mut bytes = good.to_vec();
        damages.iter().for_each(|it| it.of(&mut bytes));
        Bytes(bytes)
    });
    let inside = (select(vec!["", "lz4", "zstd"]), damages()).prop_map(|(compression, damages)| {
        let mut records = records_of_chunk(PLAIN).to_vec();
        damages.iter().for_each(|it| it.of(&mut records));
        Bytes(with_records(&records, compression))
    });
    // What is not damaged is read, so that the refused ones are refused for their damage.
    for compression in ["", "lz4", "zstd"] {
        let good = with_records(records_of_chunk(PLAIN), compression);
        assert_eq!(used(read_mcap(&good[..], "log.mcap")), Seen::Accepted);
    }
    target.run(&prop_oneof![1 => whole, 2 => inside], |bytes| {
        used(read_mcap(&bytes.0[..], "log.mcap"))
    });
}

#[test]
fn any_traffic_model_is_refused_or_rates() {
    let target = Target {
        name: "traffic",
        cases: 400,
        shrinks: 100,
        least_percent: (10, 10),
    };
    let text = TrafficModel::motorway().to_ron();
    let behaviour = DrivingBehaviour {
        speed_mps: 30.0,
        decision_s: 0.5,
        accelerations_mps2: vec![0.0, -3.0, -3.0, 0.0],
        ..DrivingBehaviour::default()
    };
    target.run(
        &mutants(vec![Source::new("motorway", text)].into()),
        |mutant| match TrafficModel::parse(&mutant.text) {
            Ok(model) => {
                let _ = format!("{model}{:?}", model.rarity(&behaviour));
                Seen::Accepted
            }
            Err(error) => {
                assert!(!error.to_string().is_empty() && !error.help().is_empty());
                Seen::Refused
            }
        },
    );
}
