//! Filters and orders of lists, and the series of an asset.

use crate::support::{Client, ServiceFixture, rig};
use serde_json::Value;

/// Returns `field` of all items of a list, over all its pages of `limit` items.
async fn all(client: &Client, path: &str, limit: u32, field: &str) -> Vec<String> {
    let (mut found, mut cursor) = (Vec::new(), String::new());
    loop {
        let page = client.get(&format!("{path}limit={limit}{cursor}")).await.expect(200);
        let items = page["items"].as_array().unwrap();
        assert!(items.len() <= limit as usize, "{page}");
        found.extend(items.iter().map(|item| item[field].as_str().unwrap().to_owned()));
        let Value::String(next) = &page["next"] else { return found };
        cursor = format!("&cursor={next}");
    }
}

/// Four ended sessions, of which `sick` has a fault, and an open one.
async fn five_sessions() -> ServiceFixture {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    for asset in ["a", "b", "ab_1", "ab-1"] {
        client.asset(asset).await;
    }
    client.telemetry("a", Some("run 1"), &rig(300, 300)).await;
    client.telemetry("a", Some("sick"), &rig(1500, 500)).await;
    client.telemetry("a", Some("run 2"), &rig(300, 300)).await;
    client.telemetry("b", Some("run_3"), &rig(300, 300)).await;
    client.end("a", "run 2").await;
    client.end("b", "run_3").await;
    client.telemetry("b", Some("now"), &rig(300, 300)).await;
    fixture
}

#[tokio::test]
async fn sessions_are_filtered_and_ordered() {
    let fixture = five_sessions().await;
    let client = &fixture.client;
    for limit in [1, 2, 500] {
        for (query, expected) in [
            ("", &["now", "run_3", "run 2", "sick", "run 1"][..]),
            ("sort=opened_at&", &["run 1", "sick", "run 2", "run_3", "now"]),
            ("verdict=fault&", &["sick"]),
            ("verdict=no_fault&", &["run_3", "run 2", "run 1"]),
            ("verdict=no_fault&asset=a&sort=opened_at&", &["run 1", "run 2"]),
            ("name=run&", &["run_3", "run 2", "run 1"]),
            ("name=run_&", &["run_3"]),
            ("name=%25&", &[]),
            ("state=open&", &["now"]),
            ("state=ended&name=n&", &[]),
        ] {
            let found = all(client, &format!("sessions?{query}"), limit, "name").await;
            assert_eq!(found, expected, "{query} by {limit}");
        }
    }
    let opened = all(client, "sessions?sort=opened_at&", 500, "opened_at").await;
    for (query, expected) in [
        (format!("opened_from={}&", opened[2]), &["now", "run_3", "run 2"][..]),
        (format!("opened_to={}&", opened[2]), &["sick", "run 1"]),
        (format!("opened_from={}&opened_to={}&", opened[1], opened[3]), &["run 2", "sick"]),
        (format!("opened_from={0}&opened_to={0}&", opened[1]), &[]),
    ] {
        assert_eq!(all(client, &format!("sessions?{query}"), 2, "name").await, expected, "{query}");
    }
}

#[tokio::test]
async fn the_fleet_and_the_assets_are_filtered() {
    let fixture = five_sessions().await;
    let client = &fixture.client;
    for limit in [1, 500] {
        for (query, expected) in [
            ("", &["a", "ab-1", "ab_1", "b"][..]),
            ("name=ab&", &["ab-1", "ab_1"]),
            ("name=ab_&", &["ab_1"]),
            ("has_fault=true&", &["a"]),
            ("has_fault=false&", &["ab-1", "ab_1", "b"]),
            ("has_session=true&", &["b"]),
            ("has_session=false&has_fault=false&", &["ab-1", "ab_1"]),
        ] {
            let found = all(client, &format!("fleet?{query}"), limit, "asset").await;
            assert_eq!(found, expected, "{query} by {limit}");
        }
        let found = all(client, "assets?name=ab&", limit, "name").await;
        assert_eq!(found, ["ab-1", "ab_1"]);
    }
}

/// Every row of a series is what the sessions, their verdicts and the trends say.
#[tokio::test]
async fn a_series_has_the_results_of_the_sessions() {
    let fixture = five_sessions().await;
    let client = &fixture.client;
    let series = client.get("assets/a/series").await.expect(200);
    let rows = series["rows"].as_array().unwrap();
    let sessions = client.get("sessions?asset=a&sort=opened_at").await.expect(200);
    let points = client.get("assets/a/trends").await.expect(200)["points"].clone();
    let sessions = sessions["items"].as_array().unwrap();
    assert_eq!((rows.len(), sessions.len()), (3, 3), "{series}");
    for (row, session) in rows.iter().zip(sessions) {
        let verdict = &session["verdict"];
        assert_eq!(row["time"], session["opened_at"]);
        assert_eq!((&row["sessions"], &row["samples"]), (&1.into(), &session["samples"]));
        assert_eq!(row["faulty"], u64::from(session["name"] == "sick"), "{row}");
        for monitor in verdict["monitors"].as_array().unwrap() {
            let name = format!("judged_{}", monitor["code"].as_str().unwrap());
            assert_eq!(row[&name], monitor["judged_share"], "{row}");
        }
        for residual in ["residual_x_m_s2", "residual_y_m_s2"] {
            assert_eq!(row[residual], verdict[residual], "{row}");
        }
        let point = points.as_array().unwrap().iter().find(|p| p["session"] == session["name"]);
        let estimate = point.map_or(&Value::Null, |point| &point["y"]);
        assert_eq!(row["gain_y"], estimate["gain"], "{row}");
        assert_eq!(row["delay_y_s"], estimate["delay_s"], "{row}");
    }

    // All sessions within one long step.
    let steps = client.get("assets/a/series?step_s=31622400&aggregate=max").await.expect(200);
    let [step] = &steps["rows"].as_array().unwrap()[..] else { panic!("{steps}") };
    assert_eq!((&step["sessions"], &step["faulty"]), (&3.into(), &1.into()));
    let judged = rows.iter().map(|row| row["judged_sensor"].as_f64().unwrap());
    assert_eq!(step["judged_sensor"].as_f64(), judged.reduce(f64::max));

    let second = rows[1]["time"].as_str().unwrap();
    let later = client.get(&format!("assets/a/series?from={second}")).await.expect(200);
    assert_eq!(later["rows"], Value::from(&rows[1..]));
    let earlier = client.get(&format!("assets/a/series?to={second}")).await.expect(200);
    assert_eq!(earlier["rows"], Value::from(&rows[..1]));

    let request =
        client.request(reqwest::Method::GET, "assets/a/series").header("accept", "text/csv");
    let csv = client.send(request).await;
    let lines: Vec<&str> = csv.text.lines().collect();
    assert_eq!(lines.len(), 4, "{}", csv.text);
    assert!(lines[0].starts_with("time,sessions,faulty,samples,gain_x,"), "{}", lines[0]);
    let cells: Vec<&str> = lines[2].split(',').collect();
    assert_eq!(cells.len(), lines[0].split(',').count());
    assert_eq!((cells[0], cells[2]), (second, "1"));

    for (path, status) in [
        ("assets/nobody/series", 404),
        ("assets/a/series?step_s=0", 400),
        ("assets/a/series?aggregate=sum", 400),
        ("assets/a/series?from=2026-01-02T00:00:00Z&to=2026-01-01T00:00:00Z", 400),
    ] {
        client.get(path).await.problem(status);
    }
}

#[tokio::test]
async fn fault_transitions_are_marks_on_a_chart() {
    let fixture = five_sessions().await;
    let client = &fixture.client;
    let marks = client.get("annotations").await.expect(200);
    let marks = marks.as_array().unwrap();
    let id = client.session("a", "sick").await["id"].as_str().unwrap().to_owned();
    let lines = client.get(&format!("sessions/{id}/faults")).await.expect(200)["items"].clone();
    let summaries = |list: &[Value], name: &str| -> Vec<Value> {
        list.iter().map(|item| item[name].clone()).collect()
    };
    let mut expected = summaries(lines.as_array().unwrap(), "summary");
    expected.reverse();
    assert!(!expected.is_empty());
    // The next session has a transition too.
    let marks = &marks[marks.len() - expected.len()..];
    assert_eq!(summaries(marks, "text"), expected);
    let mark = &marks[0];
    let session = client.session("a", "sick").await;
    let ms = |name: &str| {
        let time: jiff::Timestamp = session[name].as_str().unwrap().parse().unwrap();
        time.as_millisecond()
    };
    let span = ms("opened_at")..=ms("ended_at");
    assert!(span.contains(&mark["time"].as_i64().unwrap()), "{mark}: {session}");
    assert!(mark["tags"].as_str().unwrap().starts_with("a,"), "{mark}");
    assert_eq!(
        client.get("annotations?asset=b").await.expect(200),
        Value::from(Vec::<Value>::new())
    );
    assert_eq!(client.get("annotations?limit=1").await.expect(200).as_array().unwrap().len(), 1);
    let future = client.get("annotations?from=2999-01-01T00:00:00Z").await.expect(200);
    assert_eq!(future, Value::from(Vec::<Value>::new()));
    client.get("annotations?asset=nobody").await.problem(404);
}
