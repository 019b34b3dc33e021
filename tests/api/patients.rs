use crate::support::{TestApp, text};
use axum::http::{Method, StatusCode};
use serde_json::{Value, json};
use surefoot::storage::Role;

#[tokio::test]
async fn a_patient_is_made_found_again_and_changed() {
    let app = TestApp::new().await;
    let new = json!({"pseudonym": "P-017", "birth_year": 1948, "sex": "female", "height_m": 1.68,
                     "uses_walking_aid": true});
    let made = app.post("/v1/patients").json(&new).send().await;
    let patient = made.expect(StatusCode::CREATED);
    insta::assert_json_snapshot!(patient, {".id" => "[id]", ".created_at" => "[time]"}, @r#"
    {
      "birth_year": 1948,
      "created_at": "[time]",
      "height_m": 1.68,
      "id": "[id]",
      "pseudonym": "P-017",
      "sex": "female",
      "uses_walking_aid": true
    }
    "#);
    let location = made.header("location");
    assert_eq!(app.get(location).send().await.expect(StatusCode::OK), patient);

    let patch = json!({"height_m": 1.7, "sex": null});
    let changed = app.request(Method::PATCH, location).json(&patch).send().await.expect(StatusCode::OK);
    assert_eq!(
        (&changed["height_m"], &changed["sex"], &changed["birth_year"]),
        (&json!(1.7), &Value::Null, &json!(1948))
    );
    assert_eq!(app.get(location).send().await.expect(StatusCode::OK), changed);
}

#[tokio::test]
async fn fields_that_do_not_fit_are_named_all_at_once() {
    let app = TestApp::new().await;
    let new = json!({"pseudonym": "Jane Doe", "birth_year": 1820, "height_m": 168});
    let answer = app.post("/v1/patients").json(&new).send().await;
    let problem = answer.refused(422, "invalid_body");
    let paths: Vec<&str> = problem["errors"].as_array().unwrap().iter().map(|e| text(&e["path"])).collect();
    assert_eq!(paths, ["birth_year", "height_m", "pseudonym"]);
}

#[tokio::test]
async fn an_unknown_field_is_refused_and_not_ignored() {
    let app = TestApp::new().await;
    let new = json!({"pseudonym": "P-1", "name": "Jane Doe"});
    let problem = app.post("/v1/patients").json(&new).send().await.refused(422, "invalid_body");
    assert!(text(&problem["detail"]).contains("unknown field `name`"), "{problem:#}");
    let patients = app.get("/v1/patients").send().await.expect(StatusCode::OK);
    assert_eq!(patients["items"], json!([]));
}

#[tokio::test]
async fn a_pseudonym_is_given_once_in_an_organisation() {
    let app = TestApp::new().await;
    let id = app.patient("P-1").await;
    app.patient("P-2").await;
    app.post("/v1/patients").json(&json!({"pseudonym": "P-1"})).send().await.refused(409, "pseudonym_taken");
    let patch = app.request(Method::PATCH, &format!("/v1/patients/{id}")).json(&json!({"pseudonym": "P-2"}));
    patch.send().await.refused(409, "pseudonym_taken");

    let elsewhere = app.stranger().await;
    let same = app.post("/v1/patients").key(&elsewhere).json(&json!({"pseudonym": "P-1"})).send().await;
    same.expect(StatusCode::CREATED);
}

#[tokio::test]
async fn another_organisations_patient_does_not_exist() {
    let app = TestApp::new().await;
    let path = format!("/v1/patients/{}", app.patient("P-1").await);
    let elsewhere = app.stranger().await;
    app.get(&path).key(&elsewhere).send().await.refused(404, "not_found");
    let patch = app.request(Method::PATCH, &path).key(&elsewhere).json(&json!({"height_m": 1.5}));
    patch.send().await.refused(404, "not_found");
    let list = app.get("/v1/patients").key(&elsewhere).send().await.expect(StatusCode::OK);
    assert_eq!(list["items"], json!([]));
}

#[tokio::test]
async fn a_device_sees_no_patients_and_a_clinician_does() {
    let app = TestApp::new().await;
    let path = format!("/v1/patients/{}", app.patient("P-1").await);
    let (device, clinician) = (app.key(Role::Device).await, app.key(Role::Clinician).await);
    app.get(&path).key(&device).send().await.refused(403, "forbidden");
    app.get("/v1/patients").key(&device).send().await.refused(403, "forbidden");
    app.get(&path).key(&clinician).send().await.expect(StatusCode::OK);
}

#[tokio::test]
async fn pages_follow_each_other_newest_first_and_keep_their_filter() {
    let app = TestApp::new().await;
    for i in 0..5 {
        app.patient(&format!("A-{i}")).await;
        app.patient(&format!("B-{i}")).await;
    }
    let mut seen = Vec::new();
    let mut next = Some("/v1/patients?limit=2&pseudonym_prefix=A-".to_owned());
    let mut pages = 0;
    while let Some(address) = next {
        let page = app.get(&address).send().await.expect(StatusCode::OK);
        seen.extend(page["items"].as_array().unwrap().iter().map(|p| text(&p["pseudonym"]).to_owned()));
        next = page["next"].as_str().map(str::to_owned);
        pages += 1;
        // A row that arrives between two pages moves nothing.
        app.patient(&format!("A-late-{pages}")).await;
    }
    assert_eq!((pages, seen), (3, ["A-4", "A-3", "A-2", "A-1", "A-0"].map(str::to_owned).to_vec()));
}

#[tokio::test]
async fn a_query_that_is_mistyped_is_refused_and_not_ignored() {
    let app = TestApp::new().await;
    for (query, path) in [
        ("limit=0", "limit"),
        ("limit=201", "limit"),
        ("limit=ten", "limit"),
        ("cursor=x", "cursor"),
        ("pseudonym_prefix=%00", "pseudonym_prefix"),
    ] {
        let problem = app.get(&format!("/v1/patients?{query}")).send().await.refused(400, "invalid_request");
        assert_eq!(problem["errors"][0]["path"], path, "{problem:#}");
    }
    let problem = app.get("/v1/patients?prefix=A").send().await.refused(400, "invalid_request");
    assert!(text(&problem["detail"]).contains("prefix"), "{problem:#}");
    app.get("/v1/patients?limit=1&limit=2").send().await.refused(400, "invalid_request");
}

#[tokio::test]
async fn a_client_that_has_the_newest_form_gets_no_body_until_it_changes() {
    let app = TestApp::new().await;
    let path = format!("/v1/patients/{}", app.patient("P-1").await);
    let first = app.get(&path).send().await;
    let tag = first.header("etag").to_owned();
    assert!(tag.starts_with('"'), "a strong tag: {tag}");
    let again = app.get(&path).header("if-none-match", &tag).send().await;
    assert_eq!((again.status, again.header("etag")), (StatusCode::NOT_MODIFIED, tag.as_str()));

    app.request(Method::PATCH, &path).json(&json!({"height_m": 1.5})).send().await.expect(StatusCode::OK);
    let changed = app.get(&path).header("if-none-match", &tag).send().await;
    assert_eq!(changed.expect(StatusCode::OK)["height_m"], 1.5);
}
