"""Subscriptions of clients: limited numbers of items, with filters that can be evaluated; a bad item affects no other."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections import Counter
from collections.abc import Sequence
from typing import Any

from asyncua import ua
from asyncua.common.utils import ServiceError
from asyncua.crypto.permission_rules import UserRole
from asyncua.server.internal_session import InternalSession
from asyncua.server.internal_subscription import InternalSubscription
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
_SCALAR_SIZE = 50  # bytes of a value that is neither a text nor an array
_BASE = ua.NodeId(ua.ObjectIds.BaseEventType)
_Value = tuple[ua.NodeId, int]  # a node and its attribute


class LimitedSubscription(InternalSubscription):
    """A subscription that sends its values in messages of limited size, one message after the other of all subscriptions.

    asyncua sends all waiting values in one message: with thousands of items it took seconds to pack, and a stop of a user waited.
    """

    turn: asyncio.Lock | None = None  # that of all subscriptions of a server
    is_named = True  # whether its client has a name; otherwise its waiting values are limited together
    _triggered_datachanges: dict[int, list[ua.MonitoredItemNotification]]

    async def publish_results(self, requestdata: Any = None) -> bool:
        """Send the waiting values, as far as the client has requested messages."""
        sent = await self._publish_one(requestdata)
        more = sent
        while more and self._triggered_datachanges and self.pub_request_callback:
            more = await self._publish_one(None)
        return sent

    async def _publish_one(self, requestdata: Any) -> bool:
        async with self.turn or contextlib.nullcontext():
            await asyncio.sleep(0)  # the methods of users are called between two messages
            return bool(await super().publish_results(requestdata))

    async def enqueue_datachange_event(
        self, mid: int, eventdata: ua.MonitoredItemNotification, maxsize: int
    ) -> None:
        """Let a value wait. Of a client without a name few wait: a million would make garbage collections long."""
        waiting = self._triggered_datachanges.get(mid)
        if not self.is_named:
            items = len(self._triggered_datachanges) + (waiting is None)
            maxsize = max(1, min(maxsize, limits.NAMELESS_WAITING // items))
        if waiting is not None:
            del waiting[: max(0, len(waiting) + 1 - maxsize)]
        await super().enqueue_datachange_event(mid, eventdata, maxsize)

    def _pop_publish_result(self) -> ua.PublishResult:
        result = super()._pop_publish_result()
        result.MoreNotifications = bool(self._triggered_datachanges)
        return result

    def _pop_triggered_datachanges(self, result: ua.PublishResult) -> None:
        """Move the values of the items that have waited longest to a message, up to ``limits.NOTIFICATIONS``."""
        sent: dict[int, list[ua.MonitoredItemNotification]] = {}
        room = limits.NOTIFICATIONS
        for item in list(self._triggered_datachanges):
            if room <= 0:
                break
            sent[item] = self._triggered_datachanges.pop(item)
            room -= len(sent[item])
        waiting, self._triggered_datachanges = self._triggered_datachanges, sent
        super()._pop_triggered_datachanges(result)
        self._triggered_datachanges = waiting


class Subscriptions(SubscriptionService):
    """All subscriptions: an event that one of them cannot process still goes to all others."""

    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        self.turn = asyncio.Lock()

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

    @property
    def event_items(self) -> int:
        """The number of their items for events: the filter of each is evaluated for each event, without a pause."""
        every = [each.monitored_item_srv._monitored_events for each in self.subscriptions.values()]
        return sum(len(items) for events in every for items in events.values())


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
        service, requested = self._service(params.SubscriptionId), params.ItemsToCreate
        assert isinstance(self.subscription_service, Subscriptions)
        limit = limits.ALL_MONITORED if self.is_named else limits.NAMELESS_MONITORED
        together = self.subscription_service.items + len(requested) <= limit
        if not together or len(service._monitored_items) + len(requested) > limits.MONITORED:
            raise ServiceError(_Codes.BadTooManyMonitoredItems)
        fresh = Counter[_Value]()
        codes = [self._refusal(each, fresh) for each in requested]
        params.ItemsToCreate = [each for each, code in zip(requested, codes, strict=True) if code is None]
        created = iter(await super().create_monitored_items(params))
        return [
            next(created) if code is None else ua.MonitoredItemCreateResult(StatusCode=ua.StatusCode(code))
            for code in codes
        ]

    def _refusal(self, requested: ua.MonitoredItemCreateRequest, fresh: Counter[_Value]) -> int | None:
        """Return why an item is refused, None if it is not; ``fresh``: the accepted items of the request, by their values."""
        item = requested.ItemToMonitor
        event = item.AttributeId == ua.AttributeIds.EventNotifier
        value = ua.NodeId() if event else item.NodeId, item.AttributeId
        limit = limits.NAMELESS_EVENTS if event else limits.NAMELESS_OF_VARIABLE
        present = self.subscription_service.event_items if event else self._monitored(value)
        if not self.is_named and present + fresh[value] >= limit:
            return _Codes.BadTooManyMonitoredItems
        fresh[value] += 1
        if weight(self.aspace.read_attribute_value(item.NodeId, item.AttributeId).Value) > limits.LARGE:
            return _Codes.BadNotSupported
        return _refusal(item.AttributeId, requested.RequestedParameters.Filter)

    def _monitored(self, value: _Value) -> int:
        """Return the number of items that monitor a value: each write of the value reaches all of them without a pause."""
        node = self.aspace.get(value[0])
        attribute = None if node is None else node.attributes.get(value[1])
        return 0 if attribute is None else len(attribute.datachange_callbacks)

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
        result, created = super()._make_monitored_item_common(params)
        created.mvalue = _Values()
        return result, created

    def _create_events_monitored_item(self, params: ua.MonitoredItemCreateRequest) -> Any:
        result = super()._create_events_monitored_item(params)
        created = self._monitored_items.get(result.MonitoredItemId)
        if created is not None:
            self.filter_by(created, params.RequestedParameters.Filter)
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
    return sum(map(weight, value)) if isinstance(value, list | tuple) else _SCALAR_SIZE


def _modified(
    service: MonitoredItemService, requested: ua.MonitoredItemModifyRequest
) -> ua.MonitoredItemModifyResult:
    found, given = service._monitored_items.get(requested.MonitoredItemId), requested.RequestedParameters
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
        (position, each.Index)
        for position, element in enumerate(elements)
        for each in element.FilterOperands
        if isinstance(each, ua.ElementOperand)
    ]
    tree = all(index > position for position, index in named) and len({index for _, index in named}) == len(
        named
    )
    return tree and len(elements) <= limits.OPERANDS
