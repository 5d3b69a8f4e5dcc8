"""An agent over LangGraph: its graph calls a model until it answers, with a tool that measures a distance.

lingjing run ssr --policy examples/own_agents/langgraph_agent.py --policy-arg model=gpt-5.4 --max-cost 1
"""

import math

from langchain_openai import ChatOpenAI
from langgraph.prebuilt import create_react_agent

from lingjing.plugins.asking import AskOptions, serve_models
from lingjing.plugins.calls import ModelCalls
from lingjing.plugins.decisions import DecisionFormat
from lingjing.plugins.policy import Brief, Decision, Inbox, Observation


def distance_m(east_1: float, north_1: float, east_2: float, north_2: float) -> float:
    """Return the distance of two places, metres."""
    return math.dist((east_1, north_1), (east_2, north_2))


class GraphAgent:
    calls, options = True, AskOptions

    def __init__(self, options: AskOptions, calls: ModelCalls) -> None:
        server = serve_models(options, calls)
        model = ChatOpenAI(model=options.model, base_url=server.url, api_key=server.key, max_retries=0)
        self.graph = create_react_agent(model, [distance_m])

    async def reset(self, brief: Brief) -> None:
        self.form = DecisionFormat(brief)
        self.system = f"You are {brief.agent}. {brief.goal}\n{brief.prompt}\nAnswer with JSON: {self.form.schema}"

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        state = f"tick {observation.tick}: {observation.entities} {inbox.messages} {inbox.receipts}"
        ended = await self.graph.ainvoke({"messages": [("system", self.system), ("user", state)]})
        return self.form.read(ended["messages"][-1].content)
