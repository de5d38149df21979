// A client of another stack (node-opcua-client) at an OPC UA server of a cell: what it sees, as one line of JSON.
//
//   node client.js URL CELL AXIS [NAME PASSWORD]
//
// It browses the axes, reads the variables of one with their units and names of states, subscribes to its position and to
// events for two seconds, tries to write, and calls Halt: without a name, or with the one given.
"use strict";
const opcua = require("node-opcua-client");

const [url, cell, axis, name, password] = process.argv.slice(2);
const URI = "urn:axisbus:opcua";

function encrypted() {
  return process.env.OPCUA_ENCRYPTED === "1";
}

async function main() {
  const seen = {};
  const client = opcua.OPCUAClient.create({
    endpointMustExist: false,
    connectionStrategy: { maxRetry: 0 },
    securityMode: encrypted() ? opcua.MessageSecurityMode.SignAndEncrypt : opcua.MessageSecurityMode.None,
    securityPolicy: encrypted() ? opcua.SecurityPolicy.Basic256Sha256 : opcua.SecurityPolicy.None,
    ...(encrypted()
      ? { certificateFile: process.env.OPCUA_CERTIFICATE, privateKeyFile: process.env.OPCUA_KEY, applicationUri: process.env.OPCUA_URI }
      : {}),
  });
  await client.connect(url);
  const identity = name
    ? { type: opcua.UserTokenType.UserName, userName: name, password }
    : { type: opcua.UserTokenType.Anonymous };
  const session = await client.createSession(identity);
  const index = (await session.readNamespaceArray()).indexOf(URI);
  const id = (path) => `ns=${index};s=Machines/${cell}${path}`;
  const of = (variable) => id(`/Axes/${axis}/${variable}`);

  const axes = await session.browse(id("/Axes"));
  seen.axes = axes.references.map((each) => each.browseName.name);
  const children = await session.browse(id(`/Axes/${axis}`));
  seen.variables = {};
  seen.methods = [];
  for (const each of children.references) {
    if (each.nodeClass === opcua.NodeClass.Method) seen.methods.push(each.browseName.name);
    if (each.nodeClass !== opcua.NodeClass.Variable) continue;
    const read = await session.read({ nodeId: each.nodeId, attributeId: opcua.AttributeIds.Value });
    const found = { value: read.value.value, status: read.statusCode.name, type: opcua.DataType[read.value.dataType] };
    found.kind = each.typeDefinition.toString();
    found.stamped = read.sourceTimestamp ? read.sourceTimestamp.getTime() / 1000 : null;
    for (const property of (await session.browse(each.nodeId)).references) {
      const given = (await session.read({ nodeId: property.nodeId, attributeId: opcua.AttributeIds.Value })).value.value;
      const named = property.browseName.name;
      if (named === "EngineeringUnits") found.unit = { symbol: given.displayName.text, number: given.unitId };
      if (named === "ValueAsText") found.text = given.text;
      if (named === "EnumValues") found.states = given.map((state) => [Number(state.value[1]), state.displayName.text]);
    }
    seen.variables[each.browseName.name] = found;
  }

  const subscription = opcua.ClientSubscription.create(session, {
    requestedPublishingInterval: 100,
    requestedLifetimeCount: 100,
    requestedMaxKeepAliveCount: 10,
    publishingEnabled: true,
  });
  const follow = (item, options) =>
    opcua.ClientMonitoredItem.create(subscription, item, options, opcua.TimestampsToReturn.Both);
  seen.positions = [];
  const position = follow(
    { nodeId: of("PositionActualValue"), attributeId: opcua.AttributeIds.Value },
    { samplingInterval: 100, discardOldest: true, queueSize: 10 });
  position.on("changed", (value) => seen.positions.push([value.value.value, value.statusCode.name]));
  seen.events = [];
  const fields = ["Message", "Severity", `${index}:Cause`, `${index}:Remedy`, `${index}:Axis`];
  const events = follow(
    { nodeId: "i=2253", attributeId: opcua.AttributeIds.EventNotifier },
    { queueSize: 50, filter: opcua.constructEventFilter(fields) });
  events.on("changed", (values) => seen.events.push(values.map((each) => (each.value && each.value.text) || each.value)));
  await new Promise((resolve) => setTimeout(resolve, 2000));

  const written = await session.write({
    nodeId: of("PositionActualValue"),
    attributeId: opcua.AttributeIds.Value,
    value: { value: { dataType: opcua.DataType.Double, value: 1 } },
  }).catch((error) => ({ name: error.message }));
  seen.written = written.name;
  const called = await session.call({ objectId: id(`/Axes/${axis}`), methodId: of("Halt"), inputArguments: [] })
    .catch((error) => ({ statusCode: { name: error.message }, outputArguments: [] }));
  seen.halt = [called.statusCode.name, ...(called.outputArguments || []).map((each) => each.value)];
  await new Promise((resolve) => setTimeout(resolve, 300));

  await subscription.terminate();
  await session.close();
  await client.disconnect();
  console.log(JSON.stringify(seen));
}

main().then(() => process.exit(0), (error) => {
  console.error(error.message);
  process.exit(1);
});
