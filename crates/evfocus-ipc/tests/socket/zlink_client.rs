//! Another implementation's client, zlink's, against our server.

use super::plain::{limits, serve};
use serde_json::{Value, json};
use zlink::varlink_service::Proxy;
use zlink::{Call, ReplyError};

#[derive(Debug, PartialEq, ReplyError)]
#[zlink(interface = "org.evfocus.Controller")]
enum Refused {
    OutOfRange { what: String, value: f64, min: f64, max: f64 },
}

#[tokio::test]
async fn zlink_introspects_calls_streams_and_understands_errors() {
    let served = serve(limits());
    let mut connection = zlink::tokio::unix::connect(&served.path).await.unwrap();

    let info = connection.get_info().await.unwrap().unwrap();
    assert_eq!(info.interfaces, ["org.varlink.service", "org.evfocus.Controller"]);
    for interface in ["org.varlink.service", "org.evfocus.Controller"] {
        let name = interface.try_into().unwrap();
        let description = connection.get_interface_description(name).await.unwrap().unwrap();
        assert_eq!(description.parse().unwrap().name().as_str(), interface);
    }

    let call = |method: &str, parameters: Value| {
        Call::new(json!({ "method": format!("org.evfocus.Controller.{method}"), "parameters": parameters }))
    };
    let (reply, _) =
        connection.call_method::<_, Value, Refused>(&call("GetStatus", json!({})), vec![]).await.unwrap();
    assert_eq!(reply.unwrap().into_parameters().unwrap()["status"]["state"], "idle");
    let move_to = call("MoveTo", json!({ "position": 2.5 }));
    let (reply, _) = connection.call_method::<_, Value, Refused>(&move_to, vec![]).await.unwrap();
    let refused = Refused::OutOfRange { what: "position".to_owned(), value: 2.5, min: 0.0, max: 1.0 };
    assert_eq!(reply.unwrap_err(), refused);

    connection.send_call(&call("Monitor", json!({})).set_more(true), vec![]).await.unwrap();
    for _ in 0..3 {
        let (reply, _) = connection.receive_reply::<Value, Refused>().await.unwrap();
        assert_eq!(reply.unwrap().continues(), Some(true));
    }
}
