"""Subscriptions of clients: limited numbers of items, with filters that can be evaluated; a bad item affects no other."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from typing import Any

from asyncua import ua
from asyncua.common.utils import ServiceError
from asyncua.crypto.permission_rules import UserRole
from asyncua.server.internal_session import InternalSession
from asyncua.server.monitored_item_service import (
    MonitoredItemData,
    MonitoredItemService,
    MonitoredItemValues,
    WhereClauseEvaluator,
)
from asyncua.server.subscription_service import SubscriptionService

from axisbus.gateway.opcua import limits

log = logging.getLogger("axisbus")
_Codes = ua.StatusCodes
_Op = ua.FilterOperator
_NOT_EVALUATED = {_Op.Like, _Op.Cast, _Op.InView, _Op.RelatedTo, _Op.BitwiseAnd, _Op.BitwiseOr}  # by asyncua
_THING = 50  # bytes of a value that is neither a text nor an array
_BASE = ua.NodeId(ua.ObjectIds.BaseEventType)


class Subscriptions(SubscriptionService):
    """All subscriptions: an event that one of them cannot process still goes to all others."""

    async def trigger_event(self, event: Any, subscription_id: int | None = None) -> None:
        """Send an event to one subscription, or to all."""
        for number, each in list(self.subscriptions.items()):
            if subscription_id in (None, number):
                try:
                    await each.monitored_item_srv.trigger_event(event)
                except Exception:
                    log.debug("OPC UA: a client's filter cannot be evaluated", exc_info=True)

    @property
    def items(self) -> int:
        """The number of their items."""
        return sum(len(each.monitored_item_srv._monitored_items) for each in self.subscriptions.values())


class _Values(MonitoredItemValues):
    """The last two values of an item, without copies: they never change, and copying thousands would load the server."""

    def set_current_datavalue(self, cur_val: ua.DataValue) -> None:
        self.old_dvalue = self.get_current_datavalue()
        self.current_dvalue = cur_val


class _Where(WhereClauseEvaluator):
    """The conditions of an event's filter; an event has its own type and the base type."""

    def _eval_el(self, index: int, event: Any) -> Any:
        element = self.elements[index]
        if element.FilterOperator == _Op.OfType:
            return self._eval_op(element.FilterOperands[0], event) in (event.EventType, _BASE)
        return super()._eval_el(index, event)


class MonitoringSession(InternalSession):
    """A session that can use only its own subscriptions, with items within ``limits``."""

    @property
    def is_named(self) -> bool:
        """Whether its client has authenticated with a name and a password."""
        return self.user is not None and self.user.role is UserRole.User and bool(self.user.name)

    def _owns(self, number: int) -> bool:
        found = self.subscription_service.subscriptions.get(int(number))
        return found is not None and found.session_id == self.session_id

    def _require_own(self, number: int) -> None:
        if not self._owns(number):
            raise ServiceError(_Codes.BadSubscriptionIdInvalid)

    def _service(self, number: int) -> Items:
        self._require_own(number)
        service = self.subscription_service.subscriptions[int(number)].monitored_item_srv
        assert isinstance(service, Items)
        return service

    async def create_monitored_items(
        self, params: ua.CreateMonitoredItemsParameters
    ) -> list[ua.MonitoredItemCreateResult]:
        """Create monitored items; an item with an invalid filter is refused, the others are created."""
        service, asked = self._service(params.SubscriptionId), params.ItemsToCreate
        assert isinstance(self.subscription_service, Subscriptions)
        most = limits.ALL_MONITORED if self.is_named else limits.NAMELESS_MONITORED
        together = self.subscription_service.items + len(asked) <= most
        if not together or len(service._monitored_items) + len(asked) > limits.MONITORED:
            raise ServiceError(_Codes.BadTooManyMonitoredItems)
        codes = [self._refusal(each) for each in asked]
        params.ItemsToCreate = [each for each, code in zip(asked, codes, strict=True) if code is None]
        made = iter(await super().create_monitored_items(params))
        return [
            next(made) if code is None else ua.MonitoredItemCreateResult(StatusCode=ua.StatusCode(code))
            for code in codes
        ]

    def _refusal(self, asked: ua.MonitoredItemCreateRequest) -> int | None:
        item = asked.ItemToMonitor
        if weight(self.aspace.read_attribute_value(item.NodeId, item.AttributeId).Value) > limits.LARGE:
            return _Codes.BadNotSupported
        return _refusal(item.AttributeId, asked.RequestedParameters.Filter)

    async def modify_monitored_items(
        self, params: ua.ModifyMonitoredItemsParameters
    ) -> list[ua.MonitoredItemModifyResult]:
        """Change the filter and the queue of items, within limits."""
        service = self._service(params.SubscriptionId)
        return [_modified(service, each) for each in params.ItemsToModify]

    async def set_monitoring_mode(self, params: ua.SetMonitoringModeParameters) -> list[ua.StatusCode]:
        """As in asyncua, for a subscription of this session."""
        self._require_own(params.SubscriptionId)
        return await super().set_monitoring_mode(params)

    async def delete_monitored_items(self, params: ua.DeleteMonitoredItemsParameters) -> list[ua.StatusCode]:
        """As in asyncua, for a subscription of this session."""
        self._require_own(params.SubscriptionId)
        return await super().delete_monitored_items(params)


class Items(MonitoredItemService):
    """The items of one subscription."""

    def _make_monitored_item_common(self, params: ua.MonitoredItemCreateRequest) -> Any:
        result, made = super()._make_monitored_item_common(params)
        made.mvalue = _Values()
        return result, made

    def _create_events_monitored_item(self, params: ua.MonitoredItemCreateRequest) -> Any:
        result = super()._create_events_monitored_item(params)
        made = self._monitored_items.get(result.MonitoredItemId)
        if made is not None:
            self.filter_by(made, params.RequestedParameters.Filter)
        return result

    def filter_by(self, item: MonitoredItemData, given: Any) -> None:
        """Set another filter for an item."""
        item.filter = given
        if isinstance(given, ua.EventFilter):
            item.where_clause_evaluator = _Where(self.logger, self.aspace, given.WhereClause)


def weight(value: object) -> int:
    """Return the approximate size of a value in a message, in bytes."""
    if isinstance(value, ua.Variant):
        return weight(value.Value)
    if isinstance(value, str | bytes):
        return len(value)
    return sum(map(weight, value)) if isinstance(value, list | tuple) else _THING


def _modified(
    service: MonitoredItemService, asked: ua.MonitoredItemModifyRequest
) -> ua.MonitoredItemModifyResult:
    found, given = service._monitored_items.get(asked.MonitoredItemId), asked.RequestedParameters
    if found is None or found.read_value_id is None:
        return ua.MonitoredItemModifyResult(StatusCode=ua.StatusCode(_Codes.BadMonitoredItemIdInvalid))
    code = _refusal(found.read_value_id.AttributeId, given.Filter)
    if code is not None:
        return ua.MonitoredItemModifyResult(StatusCode=ua.StatusCode(code))
    if given.Filter:
        service.filter_by(found, given.Filter)
    found.queue_size = min(given.QueueSize, limits.QUEUE) if given.QueueSize else limits.QUEUE
    interval = service.isub.data.RevisedPublishingInterval
    return ua.MonitoredItemModifyResult(RevisedSamplingInterval=interval, RevisedQueueSize=found.queue_size)


def _refusal(attribute: int, given: object) -> int | None:
    """Return why a filter is not valid for an item of this attribute, None if it is valid."""
    event = attribute == ua.AttributeIds.EventNotifier
    if isinstance(given, ua.EventFilter):
        return _refusal_of_event(given) if event else _Codes.BadFilterNotAllowed
    if event:
        return _Codes.BadEventFilterInvalid
    if given and not isinstance(given, ua.DataChangeFilter):
        return _Codes.BadMonitoredItemFilterUnsupported
    return None


def _refusal_of_event(given: ua.EventFilter) -> int | None:
    elements = given.WhereClause.Elements or []
    if any(each.FilterOperator in _NOT_EVALUATED for each in elements):
        return _Codes.BadFilterOperatorUnsupported  # otherwise no event would ever match
    return None if _is_small(elements) else _Codes.BadFilterNotAllowed


def _is_small(elements: Sequence[ua.ContentFilterElement]) -> bool:
    """Whether a filter has few elements that form a tree, so that each is evaluated once (OPC 10000-4 7.7.4.2)."""
    named = [
        (place, each.Index)
        for place, element in enumerate(elements)
        for each in element.FilterOperands
        if isinstance(each, ua.ElementOperand)
    ]
    tree = all(index > place for place, index in named) and len({index for _, index in named}) == len(named)
    return tree and len(elements) <= limits.OPERANDS
