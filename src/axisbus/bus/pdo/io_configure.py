"""Configure the PDOs of a node's inputs and outputs by their plan."""

from __future__ import annotations

from axisbus.bus.pdo.configure import negotiate
from axisbus.bus.pdo.io_plan import IoObjects, Used, make_io_plan
from axisbus.bus.pdo.plan import PdoPlan, Policy
from axisbus.bus.sdo.client import SdoClient
from axisbus.errors import BootError


def configure_io(sdo: SdoClient, objects: IoObjects, policy: Policy, used: Used, also: Used = ()) -> PdoPlan:
    """Plan the PDOs and configure the node, which should be pre-operational, as ``configure``; blocks for some dozen transfers.

    Raises:
        BootError: an object is in no PDO, or as ``configure``.
        SdoTimeout, SdoError, AdapterError: as ``SdoClient.upload``.
    """
    plan = negotiate(
        sdo, lambda device, less: make_io_plan(sdo.node_id, device, objects, less, used), policy, also=also
    )
    if plan.impossible:
        raise BootError(
            f"node {sdo.node_id}: {'; '.join(plan.impossible)}",
            node=sdo.node_id,
            step="PDO configuration",
            observed="; ".join(plan.notes) or "it has no more PDOs that could contain it",
            remedy="map it in [nodes.N.pdo], or allow boot to change the mapping; inputs and outputs are never transmitted "
            "by SDO",
        )
    return plan
